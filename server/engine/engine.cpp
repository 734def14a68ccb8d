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

std::string_view Engine::objection_to_restore() const {
  return recorder_ != nullptr ? "the bench records, and a recording holds one run from its start" : "";
}

ChangeView Engine::change_view(std::size_t axis) const {
  return drivebench::change_view(config_, axis, parameters_[axis], tick());
}

std::string Engine::sentence_of(Refused why, std::size_t axis) const {
  return drivebench::sentence_of(why, config_, axis, axis < newest_.size() ? latched(axis) : 0);
}

std::string Engine::try_parameter(std::size_t axis, std::uint32_t row, double value) {
  std::string problem = problem_with_write(change_view(axis), row, value);
  if (problem.empty()) count_as_written(axis, row, value);
  return problem;
}

void Engine::count_as_written(std::size_t axis, std::uint32_t row, double value) {
  axis_parameters(parameters_[axis])[row].set(parameters_[axis], value);
}

}  // namespace drivebench
