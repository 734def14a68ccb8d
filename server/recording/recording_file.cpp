#include "server/recording/recording_file.hpp"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "server/host/holder.hpp"

namespace drivebench {
namespace {

class SystemFile final : public RecordingFile {
 public:
  explicit SystemFile(int descriptor) noexcept : descriptor_(descriptor) {}
  ~SystemFile() override { close(); }
  SystemFile(const SystemFile&) = delete;
  SystemFile& operator=(const SystemFile&) = delete;

  ssize_t write(std::span<const std::byte> bytes) noexcept override {
    return ::write(descriptor_, bytes.data(), bytes.size());
  }
  int truncate(std::uint64_t size) noexcept override {
    return ::ftruncate(descriptor_, static_cast<off_t>(size));
  }
  int sync() noexcept override { return ::fdatasync(descriptor_); }
  int close() noexcept override {
    if (descriptor_ < 0) return 0;
    return ::close(std::exchange(descriptor_, -1));
  }
  std::uint64_t free_bytes() noexcept override {
    struct statvfs disk {};
    if (::fstatvfs(descriptor_, &disk) != 0) return RecordingFile::free_bytes();
    return std::uint64_t{disk.f_bavail} * disk.f_frsize;
  }

 private:
  int descriptor_;
};

}  // namespace

std::unique_ptr<RecordingFile> create_recording_file(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (descriptor < 0) {
    const int error = errno;
    throw std::system_error(error, std::generic_category(),
                            "cannot create the recording " + path.string() + holder_of_file(path.string()));
  }
  sync_folder_of(path);
  return std::make_unique<SystemFile>(descriptor);
}

void sync_folder_of(const std::filesystem::path& path) noexcept {
  const std::string folder = path.has_parent_path() ? path.parent_path().string() : ".";
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  [[maybe_unused]] const int done = ::fsync(descriptor);  // some file systems do not support it
  ::close(descriptor);
}

}  // namespace drivebench
