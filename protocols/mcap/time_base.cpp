#include "protocols/mcap/time_base.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <ctime>
#include <stdexcept>
#include <string>

#include "protocols/text.hpp"

namespace drivebench {
namespace {

constexpr std::string_view kSinceTick = "since_tick";
constexpr std::string_view kEpoch = "epoch_unix_ns";

/// The rule for people who meet the record in a viewer.
constexpr std::string_view kReading =
    "log time [ns] + epoch_unix_ns = UTC at which the sample was due, in ns since 1970-01-01, for the "
    "samples "
    "after since_tick; the ticks follow CLOCK_MONOTONIC, also when the wall clock is set";

// The range of dates that every reader of exports has.
constexpr std::uint64_t kMostEpochNs = 7'258'118'400'000'000'000;  // the year 2200
constexpr std::uint64_t kMostTick = std::uint64_t{1} << 62;

/// A whole number from 0 to `most`.
std::uint64_t number_in(const McapMetadata& metadata, std::string_view key, std::uint64_t most) {
  const auto entry = metadata.entries.find(key);
  const std::string_view text = entry == metadata.entries.end() ? std::string_view() : entry->second;
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size() && value <= most) return value;
  throw std::runtime_error(
      "the metadata " + std::string(metadata.name) + " of the recording: " + std::string(key) + " is '" +
      printable(text.substr(0, 32)) + "', not a whole number from 0 to " + std::to_string(most));
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
  return TimeBase{.since_tick = number_in(*newest, kSinceTick, kMostTick),
                  .epoch_unix_ns = static_cast<std::int64_t>(number_in(*newest, kEpoch, kMostEpochNs))};
}

std::string utc_text(std::int64_t unix_ns) {
  const std::int64_t below_second_ns = (unix_ns % 1'000'000'000 + 1'000'000'000) % 1'000'000'000;
  const std::time_t second = (unix_ns - below_second_ns) / 1'000'000'000;
  std::tm utc{};
  gmtime_r(&second, &utc);
  std::array<char, 32> text{};
  const std::size_t size = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &utc);
  const std::string microseconds = std::to_string(1'000'000 + below_second_ns / 1000).substr(1);
  return std::string(text.data(), size) + "." + microseconds + "Z";
}

}  // namespace drivebench
