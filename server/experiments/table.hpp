#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace drivebench {

/// Points of a signal over time, on disk: a file without a name that goes with the object. One thread adds
/// rows, and stops before others look at them.
class SignalTable {
 public:
  struct Row {
    double time_s;
    double value;
  };

  /// Throws std::system_error if the folder takes no file.
  explicit SignalTable(const std::filesystem::path& folder);
  ~SignalTable();
  SignalTable(const SignalTable&) = delete;
  SignalTable& operator=(const SignalTable&) = delete;

  /// Rows in the order of their times, which must be finite and rise. Throws std::system_error if the disk
  /// takes no more; then the table holds what it held before.
  void append(std::span<const Row> rows);
  std::uint64_t size() const noexcept { return size_; }
  double last_time_s() const noexcept { return last_time_s_; }

 private:
  friend class TableView;
  int descriptor_;
  std::uint64_t size_ = 0;
  double last_time_s_ = 0.0;
};

/// A whole table, mapped for reading: a pure function of time.
class TableView {
 public:
  /// Throws std::system_error if it cannot be mapped. An empty table is 0 everywhere.
  explicit TableView(const SignalTable& table);
  /// The same over rows in memory, which must outlive it.
  explicit TableView(std::span<const SignalTable::Row> rows) noexcept : rows_(rows) {}
  ~TableView();
  TableView(TableView&& other) noexcept;
  TableView& operator=(TableView&&) = delete;

  /// The value of the last row that is not later, or a straight line from it to the next; 0 before the first
  /// row, the last value after the last.
  double at(double time_s, bool interpolate) const noexcept;

 private:
  std::span<const SignalTable::Row> rows_;
  void* mapping_ = nullptr;
};

}  // namespace drivebench
