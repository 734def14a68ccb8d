// Frames of a session, by bytes or by a program (request_program.hpp): what is parsed stays within its bounds
// of elements and memory. The search keeps what costs more memory for each byte, and more allocations.
#include <algorithm>
#include <array>
#include <span>
#include <string>

#include "server/endpoints/tcp/session/request_bounds.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/quiet_protobuf.hpp"
#include "tests/fuzz/request_program.hpp"
#include "tests/fuzz/request_promises.hpp"

namespace drivebench::fuzz {
namespace {

/// libFuzzer takes a counter that is set for the first time for new code: a score that it climbs.
[[gnu::section("__libfuzzer_extra_counters")]] std::array<std::uint8_t, 256> score_counters;

void tell_score(const Taken& taken, std::size_t bytes) noexcept {
  const std::size_t each = taken.peak_bytes / (bytes + 1);
  score_counters[std::min<std::size_t>(each, 127)] = 1;
  score_counters[128 + std::min<std::size_t>(taken.calls / 128, 127)] = 1;
}

}  // namespace
}  // namespace drivebench::fuzz

/// An odd first byte: the rest is a program.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  fuzz::silence_protobuf();
  if (size == 0) return 0;
  const std::span<const std::uint8_t> rest(data + 1, size - 1);
  const std::string frame = (data[0] & 1) != 0 ? fuzz::frame_of(rest) : std::string(rest.begin(), rest.end());
  if (frame.size() > kMaxRequestFrame) return 0;
  const fuzz::FrameCost cost = fuzz::cost_of(frame);
  fuzz::require(cost.broken.empty(), cost.broken.c_str());
  fuzz::tell_score(cost.taken, frame.size());
  return 0;
}
