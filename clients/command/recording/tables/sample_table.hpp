#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/command/common/basics/output.hpp"
#include "protocols/signals/catalogue.hpp"

/// Samples as a table in a file, a row for each. Its first columns are tick and times.
namespace drivebench::command {

using Signals = std::vector<const Signal*>;

/// The time of a row.
struct RowTime {
  std::uint64_t bench_ns = 0;
  std::int64_t unix_ns = 0;  ///< UTC since 1970; only in tables with an epoch
};

/// UTC since 1970 at the bench's time zero [ns]. A table with an epoch has the column `unix_ns`.
using Epoch = std::optional<std::int64_t>;

/// A table on its way into a file.
class SampleTable {
 public:
  SampleTable() = default;
  SampleTable(const SampleTable&) = delete;
  SampleTable& operator=(const SampleTable&) = delete;
  virtual ~SampleTable() = default;

  virtual void add(const Sample& sample, const RowTime& time) = 0;
  /// No more samples come: all were of this axis. Throws std::runtime_error if the file could not be written.
  virtual void finish(const std::string& axis) = 0;
};

/// Units in the header; the shortest numbers that read back equal.
std::unique_ptr<SampleTable> csv_table(Output& out, const Signals& signals, const Epoch& epoch);

/// MATLAB 7.3, which is HDF5: a column vector for each signal, of its type, and the struct `units`. Throws
/// UsageError if the file cannot be created.
std::unique_ptr<SampleTable> mat_table(const std::string& file, const Signals& signals, const Epoch& epoch);

/// ASAM MDF 4.1: one sorted channel group whose master channel is the time; units and meanings of all
/// signals; the epoch as the start time of the measurement. Throws UsageError if the file cannot be created.
std::unique_ptr<SampleTable> mdf_table(const std::string& file, const Signals& signals, const Epoch& epoch);

}  // namespace drivebench::command
