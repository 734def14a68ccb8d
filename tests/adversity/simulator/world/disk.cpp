#include "tests/adversity/simulator/world/disk.hpp"

#include <algorithm>
#include <cerrno>

namespace drivebench::simulator {

class FakeDisk::File final : public RecordingFile {
 public:
  File(FakeDisk& disk, std::shared_ptr<Bytes> bytes) : disk_(disk), bytes_(std::move(bytes)) {}

  ssize_t write(std::span<const std::byte> bytes) noexcept override {
    if (disk_.random_.chance(disk_.faults_.write_error)) return refuse(EIO);
    std::size_t size = bytes.size();
    if (size > 1 && disk_.random_.chance(disk_.faults_.short_write)) size = 1 + disk_.random_.below(size - 1);
    size = std::min<std::size_t>(size, disk_.faults_.capacity - disk_.used_);
    if (size == 0) return refuse(ENOSPC);
    bytes_->insert(bytes_->end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    disk_.used_ += size;
    return static_cast<ssize_t>(size);
  }
  int truncate(std::uint64_t size) noexcept override {
    disk_.used_ -= bytes_->size() - std::min<std::uint64_t>(size, bytes_->size());
    bytes_->resize(size);
    return 0;
  }
  int sync() noexcept override {
    return disk_.random_.chance(disk_.faults_.sync_error) ? static_cast<int>(refuse(EIO)) : 0;
  }
  int close() noexcept override { return 0; }

 private:
  ssize_t refuse(int error) noexcept {
    disk_.failed_ = true;
    errno = error;
    return -1;
  }

  FakeDisk& disk_;
  std::shared_ptr<Bytes> bytes_;
};

CreateRecordingFile FakeDisk::creator() {
  return [this](const std::filesystem::path&) {
    files_.push_back(std::make_shared<Bytes>());
    return std::make_unique<File>(*this, files_.back());
  };
}

std::vector<std::span<const std::byte>> FakeDisk::files() const {
  std::vector<std::span<const std::byte>> all;
  for (const auto& bytes : files_)
    all.emplace_back(*bytes);
  return all;
}

}  // namespace drivebench::simulator
