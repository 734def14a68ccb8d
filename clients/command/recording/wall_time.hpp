#pragma once

#include <cstddef>
#include <cstdint>

#include "clients/command/recording/recording_file.hpp"
#include "clients/command/recording/tables/sample_table.hpp"
#include "protocols/mcap/time_base.hpp"

namespace drivebench::command {

/// The epoch of a recording, which precedes its first sample after tick 0; nothing if it was not made in real
/// time.
Epoch epoch_of(const MappedSeries& files);

/// UTC at which messages were due, by the time base in force; the epoch holds before the first one.
class WallTime {
 public:
  explicit WallTime(const Epoch& epoch);

  /// Of a message of this log time, which the file has just given [ns]. Without an epoch: the log time.
  std::int64_t unix_ns_of(const McapReader& file, std::uint64_t log_time_ns);

 private:
  bool is_known_;
  TimeBase base_;
  const McapReader* file_ = nullptr;
  std::size_t seen_ = 0;  ///< metadata of the file
};

}  // namespace drivebench::command
