#include "protocols/mcap/time_base.hpp"

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <string>

namespace drivebench {
namespace {

constexpr std::string_view kSinceTick = "since_tick";
constexpr std::string_view kEpoch = "epoch_unix_ns";

/// The rule for people who meet the record in a viewer.
constexpr std::string_view kReading =
    "log time [ns] + epoch_unix_ns = UTC at which the sample was due, in ns since 1970-01-01, for the "
    "samples "
    "after since_tick; the ticks follow CLOCK_MONOTONIC, also when the wall clock is set";

template <class Integer>
Integer number_in(const McapMetadata& metadata, std::string_view key) {
  const auto entry = metadata.entries.find(key);
  const std::string_view text = entry == metadata.entries.end() ? std::string_view() : entry->second;
  Integer value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size()) return value;
  throw std::runtime_error("the metadata " + std::string(metadata.name) +
                           " of the recording: " + std::string(key) + " is '" + std::string(text) +
                           "', not a whole number of 64 bits");
}

}  // namespace

McapMap entries_of(const TimeBase& base) {
  return {{std::string(kSinceTick), std::to_string(base.since_tick)},
          {std::string(kEpoch), std::to_string(base.epoch_unix_ns)},
          {"reading", std::string(kReading)}};
}

std::optional<TimeBase> time_base_at(const McapReader& reader) {
  const auto& metadata = reader.metadata();
  const auto newest = std::find_if(metadata.rbegin(), metadata.rend(),
                                   [](const McapMetadata& each) { return each.name == kTimeBaseMetadata; });
  if (newest == metadata.rend()) return std::nullopt;
  return TimeBase{.since_tick = number_in<std::uint64_t>(*newest, kSinceTick),
                  .epoch_unix_ns = number_in<std::int64_t>(*newest, kEpoch)};
}

}  // namespace drivebench
