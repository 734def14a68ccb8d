#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "clients/command/output.hpp"
#include "protocols/catalogue.hpp"

namespace drivebench::command {

/// Takes the rows of an experiment as they come, in any number of pieces, and writes them as CSV; nothing is
/// written twice, whatever is sent twice.
class DataWriter {
 public:
  /// Without a file and without standard output the rows are only counted.
  DataWriter(const std::string& file, bool standard_output);

  /// What the rows are; before the first of them. Throws std::runtime_error if it is nonsense.
  void describe(const v1::ExperimentInfo& info);
  /// Throws std::runtime_error if rows are missing before these.
  void take(const v1::ExperimentData& data);
  void flush();

  std::uint64_t rows() const noexcept { return rows_; }
  /// The tick of the row that is due next.
  std::uint64_t next_tick() const noexcept { return rows_ * decimation_; }

 private:
  void write_row(const char* values);

  std::unique_ptr<Output> out_;
  std::vector<const Signal*> signals_;
  std::uint64_t decimation_ = 1;
  std::uint64_t period_ns_ = 0;
  std::uint64_t rows_ = 0;
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
