#include "clients/command/recording/wall_time.hpp"

namespace drivebench::command {

Epoch epoch_of(const MappedSeries& files) {
  McapSeries reader(files.segments());
  for (McapMessage message; reader.next(message);) {
    if (const auto base = time_base_at(reader.reader())) return base->epoch_unix_ns;
    if (message.header.log_time_ns > 0) break;
  }
  return std::nullopt;
}

WallTime::WallTime(const Epoch& epoch)
    : is_known_(epoch.has_value()), base_{.since_tick = 0, .epoch_unix_ns = epoch.value_or(0)} {}

std::int64_t WallTime::unix_ns_of(const McapReader& file, std::uint64_t log_time_ns) {
  if (is_known_ && (&file != file_ || file.metadata().size() != seen_)) {
    file_ = &file;
    seen_ = file.metadata().size();
    base_ = time_base_at(file).value_or(base_);
  }
  return base_.unix_ns(log_time_ns);
}

}  // namespace drivebench::command
