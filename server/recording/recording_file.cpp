#include "server/recording/recording_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "server/host/holder.hpp"

namespace drivebench {
namespace {

bool is_same_file(const struct stat& a, const struct stat& b) noexcept {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

/// The present name of an open file, as the kernel knows it; empty if it has none.
std::string present_name(int descriptor, const struct stat& file) {
  std::array<char, 4096> name;
  const std::string link = "/proc/self/fd/" + std::to_string(descriptor);
  const ssize_t length = ::readlink(link.c_str(), name.data(), name.size());
  if (length <= 0 || static_cast<std::size_t>(length) == name.size()) return {};
  const std::string path(name.data(), static_cast<std::size_t>(length));
  struct stat named {};
  return ::stat(path.c_str(), &named) == 0 && is_same_file(named, file) ? path : std::string();
}

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
  FileFate fate(const std::string& path, std::uint64_t size) override {
    struct stat file {};
    if (::fstat(descriptor_, &file) != 0) return {};
    if (file.st_nlink == 0) return {FileFate::Kind::kRemoved};
    if (static_cast<std::uint64_t>(file.st_size) != size) return {FileFate::Kind::kChanged};
    struct stat named {};
    const int found = path.empty() ? 0 : ::stat(path.c_str(), &named);
    const bool is_gone = found != 0 && (errno == ENOENT || errno == ENOTDIR);
    const bool is_another = found == 0 && !path.empty() && !is_same_file(named, file);
    if (!is_gone && !is_another) return {};
    return {FileFate::Kind::kMoved, present_name(descriptor_, file)};
  }

 private:
  int descriptor_;
};

}  // namespace

std::unique_ptr<RecordingFile> create_recording_file(const std::filesystem::path& path) {
  // O_APPEND: a file that another program empties stays shorter than what was written, and fate() sees it.
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
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
