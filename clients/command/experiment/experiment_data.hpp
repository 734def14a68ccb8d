#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/command/common/basics/output.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {

/// Collects the rows of an experiment from pieces of any size; ignores repeated rows.
class ExperimentRows {
 public:
  /// Sets the signals of the rows; to be called before the first row. Returns whether this is the first
  /// description. Throws std::runtime_error if descriptions contradict each other.
  bool describe(const v1::ExperimentInfo& info);
  /// Calls `on_row` with every new row and its tick. Throws std::runtime_error if rows before it are missing.
  using OnRow = std::function<void(std::uint64_t tick, const std::vector<double>& values)>;
  void take(const v1::ExperimentData& data, const OnRow& on_row);

  const std::vector<const Signal*>& signals() const noexcept { return signals_; }
  std::uint64_t tick_ns() const noexcept { return period_ns_; }
  std::uint64_t decimation() const noexcept { return decimation_; }
  std::uint64_t rows() const noexcept { return rows_; }
  /// The tick of the row that is due next.
  std::uint64_t next_tick() const noexcept { return rows_ * decimation_; }

 private:
  std::vector<const Signal*> signals_;
  std::uint64_t decimation_ = 1;
  std::uint64_t period_ns_ = 0;
  std::uint64_t rows_ = 0;
  std::vector<double> values_;
};

/// Writes the rows of an experiment as CSV.
class DataWriter {
 public:
  /// Without a file and standard output it only counts the rows.
  DataWriter(std::string file, bool standard_output)
      : file_(std::move(file)), is_wanted_(!file_.empty() || standard_output) {}

  /// The first description creates the file; until then an existing file keeps its content.
  void describe(const v1::ExperimentInfo& info);
  void take(const v1::ExperimentData& data);
  void flush();

  std::uint64_t rows() const noexcept { return rows_.rows(); }
  /// The tick of the row that is due next.
  std::uint64_t next_tick() const noexcept { return rows_.next_tick(); }

 private:
  void write_row(std::uint64_t tick, const std::vector<double>& values);

  std::string file_;
  bool is_wanted_;
  std::optional<Output> out_;
  ExperimentRows rows_;
  std::string text_;
};

/// Writes the bytes of a recording to a file.
class RecordingDownload {
 public:
  explicit RecordingDownload(std::string file) : file_(std::move(file)) {}
  /// Creates the file; to be called before the first bytes.
  void describe() {
    if (!out_) out_.emplace(file_);
  }
  void take(const v1::ExperimentData& data);
  void flush() { out_->flush(); }
  std::uint64_t bytes() const noexcept { return bytes_; }

 private:
  std::string file_;
  std::optional<Output> out_;
  std::uint64_t bytes_ = 0;
};

}  // namespace drivebench::command
