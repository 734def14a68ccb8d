// Requests of experiments: each is refused with the name of a field, or becomes a plan that keeps its bounds
// and commands numbers.
#include <bench.pb.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "server/experiments/plan.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/quiet_protobuf.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::fuzz {
namespace {

const BenchConfig& bench() {
  static const BenchConfig config = servo_bench();
  return config;
}

std::shared_ptr<const SignalTable> no_tables(std::uint64_t) {
  return nullptr;
}

void check_plan(const ExperimentPlan& plan) {
  require(plan.ticks >= 1 && plan.ticks <= kMaxExperimentTicks, "the length is within its bounds");
  require(plan.decimation >= 1 && plan.decimation <= plan.ticks, "there is a row at least");
  require(!plan.signals.empty(), "there is something to send");
  require(plan.shapes.size() <= kMaxShapes && plan.events.size() <= kMaxPlannedEvents,
          "the plan is as short as it must be");
  require(std::ranges::is_sorted(plan.events, {}, &PlannedEvent::tick), "events come in order");
  if (!plan.has_commands()) return;
  for (const Tick tick : std::array{Tick{0}, plan.ticks / 3, plan.ticks - 1}) {
    require(is_finite(command_of(plan, Sample{}, tick)), "a command is made of numbers");
  }
}

}  // namespace
}  // namespace drivebench::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  fuzz::silence_protobuf();
  v1::RunExperiment request;
  if (!request.ParseFromArray(data, static_cast<int>(size))) return 0;
  try {
    fuzz::check_plan(make_plan(request, fuzz::bench(), fuzz::no_tables));
  } catch (const BadRequest& bad) {
    fuzz::require(!bad.field().empty() && *bad.what() != '\0', "a refusal names the field and the rule");
  }
  return 0;
}
