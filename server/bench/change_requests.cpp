#include "server/bench/change_requests.hpp"

#include <cmath>
#include <optional>
#include <vector>

#include "plant/injected_faults.hpp"
#include "plant/parameters/drive_rows.hpp"
#include "plant/parameters/parameters.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench {
namespace {

using Objection = std::optional<RefusedRequest>;

Objection objection_to_ticks(std::uint64_t ticks, std::string_view field) {
  if (ticks <= kMaxTick) return std::nullopt;
  return RefusedRequest{TcpRefusal::kOutOfRange,
                        std::string(field) + " is " + std::to_string(ticks) + " but must not exceed 2^53",
                        field};
}

TcpRefusal code_for(double value) {
  return std::isfinite(value) ? TcpRefusal::kOutOfRange : TcpRefusal::kNotFinite;
}

Objection objection_to_amount(double value, double bound, std::string_view unit, std::string_view field) {
  if (std::abs(value) <= bound) return std::nullopt;
  return RefusedRequest{code_for(value),
                        std::string(field) + " is " + shortest(value) + " but must lie between " +
                            shortest(-bound) + " and " + shortest(bound) + " " + std::string(unit),
                        field};
}

}  // namespace

std::string problem_with_value(const ChangeView& axis, std::uint32_t row, double value) {
  const Parameter& parameter = axis_parameters(axis.parameters)[row];
  if (!axis.shaft_of.empty() && parameter.name.starts_with("mechanics.")) {
    return "belongs to axis " + std::string(axis.shaft_of) + ", whose shaft this axis shares";
  }
  if (!axis.amplifier_of.empty() && is_of_drive(parameter.name)) {
    return "belongs to axis " + std::string(axis.amplifier_of) + ", whose amplifier this axis shares";
  }
  return problem_with(parameter, value);
}

std::string problem_with_write(const ChangeView& axis, std::uint32_t row, double value) {
  if (std::string problem = problem_with_value(axis, row, value); !problem.empty()) return problem;
  AxisParameters wanted = axis.parameters;
  axis_parameters(wanted)[row].set(wanted, value);
  std::vector<Problem> found = problems(wanted);
  Problems of_both(found);
  if (axis.drives_another) add_shared_problems(wanted.drive, of_both);
  if (!found.empty()) {
    return "would break a rule: " + found.front().field + " " + found.front().rule;
  }
  return {};
}

std::string unknown_parameter(const AxisParameters& parameters, std::string_view name) {
  return "there is no parameter '" + printable(name) + "'" +
         did_you_mean(name, axis_parameters(parameters), &Parameter::name);
}

std::string unknown_fault(std::string_view name) {
  return "there is no fault '" + printable(name) + "'" +
         did_you_mean(name, kInjectableFaults, &InjectableFault::name);
}

JudgedRequest judge_parameter(const ChangeView& axis, std::string_view name, double value,
                              std::uint64_t ramp_ticks, std::uint64_t at_tick) {
  const Parameter* const row = find_parameter(axis.parameters, name);
  if (row == nullptr) {
    return RefusedRequest{TcpRefusal::kUnknownParameter, unknown_parameter(axis.parameters, name), "name"};
  }
  if (!row->live) {
    return RefusedRequest{TcpRefusal::kReadOnly,
                          std::string(name) + " cannot be changed while the bench runs", "name"};
  }
  if (auto objection = objection_to_ticks(ramp_ticks, "ramp_ticks")) return *std::move(objection);
  if (auto objection = objection_to_ticks(at_tick, "at_tick")) return *std::move(objection);
  if (row->integer && ramp_ticks != 0) {
    return RefusedRequest{TcpRefusal::kOutOfRange,
                          "ramp_ticks is " + std::to_string(ramp_ticks) +
                              " but must be 0: " + std::string(name) + " has no values in between",
                          "ramp_ticks"};
  }
  const auto index = static_cast<std::uint32_t>(row - axis_parameters(axis.parameters).data());
  const bool later = static_cast<Tick>(at_tick) > axis.tick;
  const std::string problem =
      later ? problem_with_value(axis, index, value) : problem_with_write(axis, index, value);
  if (!problem.empty()) return RefusedRequest{code_for(value), std::string(name) + " " + problem, "value"};
  return ParameterWrite{.row = index, .value = value, .ramp_ticks = static_cast<Tick>(ramp_ticks)};
}

JudgedRequest judge_load(double load_nm, std::uint64_t ramp_ticks, std::uint64_t at_tick) {
  if (auto objection = objection_to_amount(load_nm, kMaxLoadNm, "N*m", "load_nm"))
    return *std::move(objection);
  if (auto objection = objection_to_ticks(ramp_ticks, "ramp_ticks")) return *std::move(objection);
  if (auto objection = objection_to_ticks(at_tick, "at_tick")) return *std::move(objection);
  return LoadChange{.load_nm = load_nm, .ramp_ticks = static_cast<Tick>(ramp_ticks)};
}

JudgedRequest judge_fault(std::string_view name, double value, std::uint64_t at_tick) {
  const std::size_t row = find_injectable_fault(name);
  if (row == kInjectableFaultCount) {
    return RefusedRequest{TcpRefusal::kUnknownFault, unknown_fault(name), "name"};
  }
  if (const std::string problem = problem_with(kInjectableFaults[row], value); !problem.empty()) {
    return RefusedRequest{code_for(value), std::string(name) + " " + problem, "value"};
  }
  if (auto objection = objection_to_ticks(at_tick, "at_tick")) return *std::move(objection);
  return InjectFault{.row = static_cast<std::uint32_t>(row), .value = value};
}

JudgedRequest judge_bump(double impulse_nms, std::uint64_t at_tick) {
  if (auto objection = objection_to_amount(impulse_nms, kMaxImpulseNms, "N*m*s", "impulse_nms")) {
    return *std::move(objection);
  }
  if (auto objection = objection_to_ticks(at_tick, "at_tick")) return *std::move(objection);
  return ShaftBump{impulse_nms};
}

}  // namespace drivebench
