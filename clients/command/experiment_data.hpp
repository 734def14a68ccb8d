#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "clients/command/output.hpp"
#include "protocols/catalogue.hpp"

namespace drivebench::command {

/// Takes the rows of an experiment as they come, in any number of pieces; none is taken twice, whatever is
/// sent twice.
class ExperimentRows {
 public:
  /// What the rows are; before the first of them. Gives whether that was new. Throws std::runtime_error if it
  /// is nonsense.
  bool describe(const v1::ExperimentInfo& info);
  /// Hands every new row to `on_row`, with its tick. Throws std::runtime_error if rows are missing before
  /// them.
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
  /// Without a file and without standard output the rows are only counted.
  DataWriter(const std::string& file, bool standard_output);

  void describe(const v1::ExperimentInfo& info);
  void take(const v1::ExperimentData& data);
  void flush();

  std::uint64_t rows() const noexcept { return rows_.rows(); }
  /// The tick of the row that is due next.
  std::uint64_t next_tick() const noexcept { return rows_.next_tick(); }

 private:
  void write_row(std::uint64_t tick, const std::vector<double>& values);

  std::unique_ptr<Output> out_;
  ExperimentRows rows_;
  std::string text_;
};

/// The same for the bytes of a recording.
class RecordingWriter {
 public:
  explicit RecordingWriter(const std::string& file) : out_(file) {}
  void take(const v1::ExperimentData& data);
  void flush() { out_.flush(); }
  std::uint64_t bytes() const noexcept { return bytes_; }

 private:
  Output out_;
  std::uint64_t bytes_ = 0;
};

}  // namespace drivebench::command
