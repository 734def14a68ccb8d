#include "tests/adversity/simulator/world/disk.hpp"

#include <algorithm>
#include <cerrno>
#include <utility>

namespace drivebench::simulator {

class FakeDisk::File final : public RecordingFile {
 public:
  File(FakeDisk& disk, std::shared_ptr<Content> content) : disk_(disk), content_(std::move(content)) {}

  ssize_t write(std::span<const std::byte> bytes) noexcept override {
    if (disk_.random_.chance(disk_.faults_.write_error)) return refuse(EIO);
    std::size_t size = bytes.size();
    if (size > 1 && disk_.random_.chance(disk_.faults_.short_write)) size = 1 + disk_.random_.below(size - 1);
    size = std::min<std::size_t>(size, disk_.faults_.capacity - disk_.used_);
    if (size == 0) return refuse(ENOSPC);
    content_->bytes.insert(content_->bytes.end(), bytes.begin(),
                           bytes.begin() + static_cast<std::ptrdiff_t>(size));
    disk_.used_ += size;
    return static_cast<ssize_t>(size);
  }
  int truncate(std::uint64_t size) noexcept override {
    disk_.used_ -= content_->bytes.size() - std::min<std::uint64_t>(size, content_->bytes.size());
    content_->bytes.resize(size);
    return 0;
  }
  int sync() noexcept override {
    return disk_.random_.chance(disk_.faults_.sync_error) ? static_cast<int>(refuse(EIO)) : 0;
  }
  int close() noexcept override {
    content_->is_given_up = true;
    return 0;
  }
  FileFate fate(const std::string& /*path*/, std::uint64_t /*size*/) override {
    const bool is_moved = content_->fate.kind == FileFate::Kind::kMoved;
    return is_moved ? std::exchange(content_->fate, {}) : content_->fate;
  }

 private:
  ssize_t refuse(int error) noexcept {
    disk_.failed_ = true;
    content_->is_given_up = true;
    errno = error;
    return -1;
  }

  FakeDisk& disk_;
  std::shared_ptr<Content> content_;
};

CreateRecordingFile FakeDisk::creator() {
  return [this](const std::filesystem::path& path) {
    files_.push_back(std::make_shared<Content>(Content{.path = path.string()}));
    return std::make_unique<File>(*this, files_.back());
  };
}

void FakeDisk::meddle() {
  if (!random_.chance(faults_.meddling) || files_.empty()) return;
  Content& content = *files_.back();
  if (content.is_given_up || content.is_lost || content.fate.kind != FileFate::Kind::kKept) return;
  // A program that has a file without a name open can still empty it.
  switch (content.path.empty() ? 3 : random_.below(4)) {
    case 0:
      content.path += ".moved";
      content.fate = {.kind = FileFate::Kind::kMoved, .path = content.path};
      return;
    case 1:
      content.path.clear();
      content.fate = {.kind = FileFate::Kind::kMoved};
      return;
    case 2:
      content.fate = {.kind = FileFate::Kind::kRemoved};
      break;
    default:
      content.fate = {.kind = FileFate::Kind::kChanged};
      break;
  }
  content.is_lost = lost_a_file_ = true;
}

std::vector<std::span<const std::byte>> FakeDisk::files() const {
  std::vector<std::span<const std::byte>> all;
  for (const auto& content : files_) {
    if (!content->is_lost) all.emplace_back(content->bytes);
  }
  return all;
}

}  // namespace drivebench::simulator
