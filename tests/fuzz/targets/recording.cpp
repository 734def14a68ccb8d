// A recording with any contents is simulated again to a verdict: no input in it harms the bench.
#include "server/recording/replay.hpp"

#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/quiet_protobuf.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  using Result = ReplayReport::Result;
  fuzz::silence_protobuf();
  const ReplayReport report = replay(fuzz::as_bytes_of(data, size), nullptr);
  fuzz::require((report.result == Result::kEqual) == report.problem.empty(),
                "a replay that differs has a reason");
  fuzz::require(!report.difference || report.result == Result::kDifferent, "a reported difference is one");
  return 0;
}
