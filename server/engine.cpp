#include "server/engine.hpp"

#include <algorithm>

#include "plant/parameters.hpp"

namespace drivebench {

Engine::Engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder)
    : config_(config), recorder_(std::move(recorder)), newest_(config.axes.size()) {
  for (const AxisSetup& axis : config.setup.axes)
    parameters_.push_back(axis.parameters);
  const bool wanted =
      std::any_of(config.can.begin(), config.can.end(), [](const CanConfig& bus) { return bus.edges; });
  if (wanted) edges_.resize(config.axes.size());
}

std::string Engine::try_parameter(std::size_t axis, std::uint32_t row, double value) {
  const Parameter& parameter = axis_parameters()[row];
  if (std::string problem = problem_with(parameter, value); !problem.empty()) return problem;
  AxisParameters wanted = parameters_[axis];
  parameter.set(wanted, value);
  if (const std::vector<Problem> found = problems(wanted); !found.empty()) {
    return "would break a rule: " + found.front().field + " " + found.front().rule;
  }
  parameters_[axis] = wanted;
  return {};
}

void schedule_loads(const BenchConfig& config, Bench& bench) {
  for (std::uint32_t axis = 0; axis < config.axes.size(); ++axis) {
    for (const LoadEvent& event : config.axes[axis].loads) {
      bench.submit({.tick = event.tick, .axis = axis, .owner = 0, .action = event.change});
    }
  }
}

}  // namespace drivebench
