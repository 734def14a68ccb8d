#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "clients/command/common/basics/output.hpp"
#include "protocols/signals/catalogue.hpp"

/// Samples as a table in a file, a row for each. Its first columns are tick and time.
namespace drivebench::command {

using Signals = std::vector<const Signal*>;

/// A table on its way into a file.
class SampleTable {
 public:
  SampleTable() = default;
  SampleTable(const SampleTable&) = delete;
  SampleTable& operator=(const SampleTable&) = delete;
  virtual ~SampleTable() = default;

  virtual void add(const Sample& sample, std::uint64_t time_ns) = 0;
  /// No more samples come: all were of this axis. Throws std::runtime_error if the file could not be written.
  virtual void finish(const std::string& axis) = 0;
};

/// Units in the header; the shortest numbers that read back equal.
std::unique_ptr<SampleTable> csv_table(Output& out, const Signals& signals);

/// MATLAB 7.3, which is HDF5: a column vector for each signal, of its type, and the struct `units`. Throws
/// UsageError if the file cannot be created.
std::unique_ptr<SampleTable> mat_table(const std::string& file, const Signals& signals);

/// ASAM MDF 4.1: one sorted channel group whose master channel is the time; units and meanings of all
/// signals. Throws UsageError if the file cannot be created.
std::unique_ptr<SampleTable> mdf_table(const std::string& file, const Signals& signals);

}  // namespace drivebench::command
