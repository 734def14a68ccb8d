#include "server/engine/engine.hpp"

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

void Engine::request(const Input& input, Answer answer, const Client* from) {
  if (!on_answered || std::holds_alternative<RefusedCommand>(input.action)) {
    return submit(input, std::move(answer));
  }
  const Client* known = from != nullptr ? from : client(input.owner);
  submit(input, [this, input, named = known != nullptr ? std::optional(*known) : std::nullopt,
                 answer = std::move(answer)](Refused refused, Tick tick) {
    on_answered(input, named ? &*named : nullptr, refused, tick);
    answer(refused, tick);
  });
}

void Engine::take(std::uint32_t axis, Owner by, const std::string& reason, Answer answer) {
  const Owner before = owner(axis);
  if (before != 0 && before != by) {
    request({.tick = 0, .axis = axis, .owner = before, .action = LeaseAction::kLost},
            [this, taken = Taken{axis, before, by, reason}](Refused refused, Tick) {
              if (refused != Refused::kNot) return;  // the owner has just left
              for (const auto& listener : on_taken)
                listener(taken);
            });
  }
  // Follows the other in the same queue: no request comes between the two, but one may have come before both.
  request({.tick = 0, .axis = axis, .owner = by, .action = LeaseAction::kAcquire}, std::move(answer));
}

void Engine::refuse_to_take(std::uint32_t axis, Owner by, Refused why, const Answer& answer) {
  const Input wanted{.tick = 0, .axis = axis, .owner = by, .action = LeaseAction::kAcquire};
  if (on_answered) on_answered(wanted, client(by), why, tick());
  answer(why, tick());
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
