#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace drivebench {

/// Points of a signal over time in a file, which is open only while it is read or written and which the
/// object deletes. One thread adds rows; other threads read them only afterwards.
class SignalTable {
 public:
  struct Row {
    double time_s;
    double value;
  };

  /// Throws std::system_error if the file is there already or cannot be made.
  explicit SignalTable(std::filesystem::path file);
  ~SignalTable();
  SignalTable(const SignalTable&) = delete;
  SignalTable& operator=(const SignalTable&) = delete;

  /// Appends rows, whose times must be finite and rise. On a disk error it throws std::system_error and the
  /// table stays unchanged.
  void append(std::span<const Row> rows);
  std::uint64_t size() const noexcept { return size_; }
  double last_time_s() const noexcept { return last_time_s_; }

 private:
  friend class TableView;
  std::filesystem::path file_;
  std::uint64_t size_ = 0;
  double last_time_s_ = 0.0;
};

/// A table, mapped for reading: a pure function of time.
class TableView {
 public:
  /// Throws std::system_error if it cannot be mapped. An empty table is 0 everywhere.
  explicit TableView(const SignalTable& table);
  /// A view of rows in memory, which must outlive it.
  explicit TableView(std::span<const SignalTable::Row> rows) noexcept : rows_(rows) {}
  ~TableView();
  TableView(TableView&& other) noexcept;
  TableView& operator=(TableView&&) = delete;

  /// The value of the last row that is not later, or the linear interpolation to the next row; 0 before the
  /// first row, the last value after the last row.
  double at(double time_s, bool interpolate) const noexcept;

 private:
  std::span<const SignalTable::Row> rows_;
  void* mapping_ = nullptr;
};

}  // namespace drivebench
