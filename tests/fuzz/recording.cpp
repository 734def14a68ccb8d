// A recording of anybody's making is re-simulated to a verdict: no input in it harms the bench.
#include "server/replay.hpp"

#include <google/protobuf/stubs/logging.h>

#include "tests/fuzz/fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  using Result = ReplayReport::Result;
  // Protobuf would print a line for each text that is not UTF-8.
  [[maybe_unused]] static const auto kPrinter = google::protobuf::SetLogHandler(nullptr);
  const ReplayReport report = replay(fuzz::as_bytes_of(data, size), nullptr);
  fuzz::require((report.result == Result::kEqual) == report.problem.empty(), "what is not equal says why");
  fuzz::require(!report.difference || report.result == Result::kDifferent, "a difference is one");
  return 0;
}
