#include "clients/command/recording/recorded_samples.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "protocols/sample_codec.hpp"

namespace drivebench::command {

RecordedSamples::RecordedSamples(const std::filesystem::path& file, std::vector<std::string> axes)
    : files_(open_recording(file.string())), mcap_(files_.segments()), axes_(std::move(axes)) {}

std::optional<RecordedSamples::Row> RecordedSamples::next() {
  for (McapMessage message; mcap_.next(message);) {
    const std::string_view axis = axis_of(mcap_.reader().channels().at(message.header.channel).topic);
    const auto place = static_cast<std::size_t>(std::ranges::find(axes_, axis) - axes_.begin());
    if (axis.empty() || place == axes_.size()) continue;
    if (const std::optional<Sample> sample = decode_sample(message.payload)) return Row{place, *sample};
    throw std::runtime_error("the recording is not whole: a sample cannot be read");
  }
  if (mcap_.problem()) throw std::runtime_error("the recording is not whole: " + mcap_.problem()->what);
  return std::nullopt;
}

}  // namespace drivebench::command
