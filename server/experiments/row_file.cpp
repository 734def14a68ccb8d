#include "server/experiments/row_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <system_error>
#include <utility>

namespace drivebench {

static_assert(std::endian::native == std::endian::little, "rows are written as they stand in memory");

bool write_all(int descriptor, std::span<const std::byte> bytes) noexcept {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return true;
}

RowWriter::RowWriter(const std::filesystem::path& file, std::vector<const Signal*> signals,
                     std::atomic<std::uint64_t>& published)
    : signals_(std::move(signals)),
      published_(published),
      capacity_(std::max<std::size_t>(kBufferBytes / (8 * signals_.size()), 1) * signals_.size()),
      descriptor_(::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)) {
  if (descriptor_ < 0) {
    throw std::system_error(errno, std::generic_category(), "cannot create " + file.string());
  }
  buffer_.reserve(capacity_);
}

RowWriter::~RowWriter() {
  ::close(descriptor_);
}

bool RowWriter::append(const Sample& sample) noexcept {
  for (const Signal* const signal : signals_)
    buffer_.push_back(value_of(*signal, sample));
  return buffer_.size() < capacity_ || flush();
}

bool RowWriter::flush() noexcept {
  if (!write_all(descriptor_, std::as_bytes(std::span(buffer_)))) return false;
  published_.fetch_add(buffer_.size() / signals_.size(), std::memory_order_release);
  buffer_.clear();
  return true;
}

bool RowWriter::finish() noexcept {
  return flush() && ::fdatasync(descriptor_) == 0;
}

FileReader::FileReader(const std::filesystem::path& file)
    : descriptor_(::open(file.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (descriptor_ < 0) {
    throw std::system_error(errno, std::generic_category(), "cannot read " + file.string());
  }
}

FileReader::~FileReader() {
  ::close(descriptor_);
}

void FileReader::read(std::uint64_t from, std::span<std::byte> out) const {
  while (!out.empty()) {
    const ssize_t got = ::pread(descriptor_, out.data(), out.size(), static_cast<off_t>(from));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      throw std::system_error(got == 0 ? EIO : errno, std::generic_category(), "the data cannot be read");
    }
    out = out.subspan(static_cast<std::size_t>(got));
    from += static_cast<std::uint64_t>(got);
  }
}

}  // namespace drivebench
