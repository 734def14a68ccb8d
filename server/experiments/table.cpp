#include "server/experiments/table.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

namespace drivebench {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw std::system_error(errno, std::generic_category(), what);
}

/// A file, as long as it is open.
class OpenFile {
 public:
  OpenFile(const std::filesystem::path& file, int flags)
      : descriptor_(::open(file.c_str(), flags | O_CLOEXEC, 0600)) {
    if (descriptor_ < 0) fail("cannot keep a table in " + file.string());
  }
  ~OpenFile() { ::close(descriptor_); }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  int descriptor() const noexcept { return descriptor_; }

 private:
  int descriptor_;
};

}  // namespace

SignalTable::SignalTable(std::filesystem::path file) : file_(std::move(file)) {
  const OpenFile made(file_, O_WRONLY | O_CREAT | O_EXCL);
}

SignalTable::~SignalTable() {
  ::unlink(file_.c_str());
}

void SignalTable::append(std::span<const Row> rows) {
  const OpenFile file(file_, O_WRONLY);
  std::span<const std::byte> left = std::as_bytes(rows);
  auto offset = static_cast<off_t>(size_ * sizeof(Row));
  while (!left.empty()) {
    const ssize_t written = ::pwrite(file.descriptor(), left.data(), left.size(), offset);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail("cannot keep the rows of a table");
    left = left.subspan(static_cast<std::size_t>(written));
    offset += written;
  }
  size_ += rows.size();
  if (!rows.empty()) last_time_s_ = rows.back().time_s;
}

TableView::TableView(const SignalTable& table) {
  if (table.size() == 0) return;
  const std::size_t bytes = table.size() * sizeof(SignalTable::Row);
  // A real-time server locks its mappings, for which the kernel reads the whole file: 160 MB in 50 ms, while
  // the I/O thread waits. The kernel does not read a mapping without access, and after munlock() a run reads
  // only the pages it needs.
  const OpenFile file(table.file_, O_RDONLY);
  mapping_ = ::mmap(nullptr, bytes, PROT_NONE, MAP_SHARED, file.descriptor(), 0);
  if (mapping_ == MAP_FAILED) fail("cannot map a table");
  ::munlock(mapping_, bytes);
  if (::mprotect(mapping_, bytes, PROT_READ) != 0) {
    const int error = errno;
    ::munmap(mapping_, bytes);
    errno = error;
    fail("cannot map a table");
  }
  rows_ = {static_cast<const SignalTable::Row*>(mapping_), table.size()};
}

TableView::TableView(TableView&& other) noexcept
    : rows_(other.rows_), mapping_(std::exchange(other.mapping_, nullptr)) {}

TableView::~TableView() {
  if (mapping_ != nullptr) ::munmap(mapping_, rows_.size_bytes());
}

double TableView::at(double time_s, bool interpolate) const noexcept {
  const auto later =
      std::upper_bound(rows_.begin(), rows_.end(), time_s,
                       [](double time, const SignalTable::Row& row) { return time < row.time_s; });
  if (later == rows_.begin()) return 0.0;
  const SignalTable::Row& before = *(later - 1);
  if (!interpolate || later == rows_.end()) return before.value;
  const double part = (time_s - before.time_s) / (later->time_s - before.time_s);
  return before.value + part * (later->value - before.value);
}

}  // namespace drivebench
