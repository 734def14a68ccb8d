#include "server/engine.hpp"

#include <algorithm>

#include "plant/parameters/parameters.hpp"

namespace drivebench {

Engine::Engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder)
    : config_(config),
      watch_(config.setup.period_ns),
      recorder_(std::move(recorder)),
      newest_(config.axes.size()),
      configuration_hash_(drivebench::configuration_hash(config)) {
  for (const AxisSetup& axis : config.setup.axes)
    parameters_.push_back(axis.parameters);
  const bool wanted =
      std::any_of(config.can.begin(), config.can.end(), [](const CanConfig& bus) { return bus.edges; });
  if (wanted) edges_.resize(config.axes.size());
}

std::string Engine::problem_with_value(std::size_t axis, std::uint32_t row, double value) const {
  const Parameter& parameter = axis_parameters(parameters_[axis])[row];
  const std::optional<std::size_t> partner = config_.setup.axes[axis].shares_shaft_with;
  if (partner && parameter.name.starts_with("mechanics.")) {
    return "belongs to axis " + config_.axes[*partner].name + ", whose shaft this axis shares";
  }
  return problem_with(parameter, value);
}

std::string Engine::try_parameter(std::size_t axis, std::uint32_t row, double value) {
  if (std::string problem = problem_with_value(axis, row, value); !problem.empty()) return problem;
  AxisParameters wanted = parameters_[axis];
  axis_parameters(wanted)[row].set(wanted, value);
  if (const std::vector<Problem> found = problems(wanted); !found.empty()) {
    return "would break a rule: " + found.front().field + " " + found.front().rule;
  }
  parameters_[axis] = wanted;
  return {};
}

void schedule_events(const BenchConfig& config, Bench& bench) {
  for (std::uint32_t axis = 0; axis < config.axes.size(); ++axis) {
    for (const AxisEvent& event : config.axes[axis].events) {
      bench.submit({.tick = event.tick, .axis = axis, .owner = 0, .action = event.action});
    }
  }
}

}  // namespace drivebench
