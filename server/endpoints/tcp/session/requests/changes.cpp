#include "server/endpoints/tcp/session/requests/changes.hpp"

#include <cmath>

#include "plant/parameters/parameters.hpp"
#include "plant/parameters/rows.hpp"
#include "protocols/text.hpp"

namespace drivebench {
namespace {

/// Each check below refuses the request if it returns false.
bool is_tick(Dialogue& dialogue, std::uint64_t ticks, const char* field) {
  if (ticks <= kMaxTick) return true;
  dialogue.refuse(dialogue.id(), v1::REFUSAL_OUT_OF_RANGE,
                  std::string(field) + " is " + std::to_string(ticks) + " but must not exceed 2^53", field);
  return false;
}

bool is_within(Dialogue& dialogue, double value, double bound, std::string_view unit, const char* field) {
  if (std::abs(value) <= bound) return true;
  dialogue.refuse(dialogue.id(), std::isfinite(value) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE,
                  std::string(field) + " is " + shortest(value) + " but must lie between " +
                      shortest(-bound) + " and " + shortest(bound) + " " + std::string(unit),
                  field);
  return false;
}

void refuse_value(Dialogue& dialogue, double value, const std::string& sentence) {
  dialogue.refuse(dialogue.id(), std::isfinite(value) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE,
                  sentence, "value");
}

}  // namespace

void write_parameter(Dialogue& dialogue, Leases& leases, const v1::WriteParameter& r) {
  if (!leases.may_change(r.axis())) return;
  Engine& engine = dialogue.engine();
  const AxisParameters& p = engine.parameters(r.axis());
  const Parameter* row = find_parameter(p, r.name());
  if (row == nullptr) {
    return dialogue.refuse(dialogue.id(), v1::REFUSAL_UNKNOWN_PARAMETER,
                           "there is no parameter '" + printable(r.name()) + "'", "name");
  }
  if (!row->live) {
    return dialogue.refuse(dialogue.id(), v1::REFUSAL_READ_ONLY,
                           r.name() + " cannot be changed while the bench runs", "name");
  }
  if (!is_tick(dialogue, r.ramp_ticks(), "ramp_ticks") || !is_tick(dialogue, r.at_tick(), "at_tick")) return;
  if (row->integer && r.ramp_ticks() != 0) {
    return dialogue.refuse(dialogue.id(), v1::REFUSAL_OUT_OF_RANGE,
                           "ramp_ticks is " + std::to_string(r.ramp_ticks()) + " but must be 0: " + r.name() +
                               " has no values in between",
                           "ramp_ticks");
  }
  const auto index = static_cast<std::uint32_t>(row - axis_parameters(p).data());
  const auto at_tick = static_cast<Tick>(r.at_tick());
  const bool later = at_tick > engine.tick();
  if (const std::string problem = later ? engine.problem_with_value(r.axis(), index, r.value())
                                        : engine.try_parameter(r.axis(), index, r.value());
      !problem.empty()) {
    return refuse_value(dialogue, r.value(), r.name() + " " + problem);
  }
  const ParameterWrite write{
      .row = index, .value = r.value(), .ramp_ticks = static_cast<Tick>(r.ramp_ticks())};
  leases.ask({.tick = at_tick, .axis = r.axis(), .owner = dialogue.owner(), .action = write}, "name");
}

void set_load(Dialogue& dialogue, Leases& leases, const v1::SetLoad& r) {
  if (!leases.may_change(r.axis())) return;
  if (!is_within(dialogue, r.load_nm(), kMaxLoadNm, "N*m", "load_nm")) return;
  if (!is_tick(dialogue, r.ramp_ticks(), "ramp_ticks") || !is_tick(dialogue, r.at_tick(), "at_tick")) return;
  const LoadChange change{.load_nm = r.load_nm(), .ramp_ticks = static_cast<Tick>(r.ramp_ticks())};
  leases.ask(
      {.tick = static_cast<Tick>(r.at_tick()), .axis = r.axis(), .owner = dialogue.owner(), .action = change},
      "at_tick");
}

void inject_fault(Dialogue& dialogue, Leases& leases, const v1::InjectFault& r) {
  if (!leases.may_change(r.axis())) return;
  const std::size_t row = find_injectable_fault(r.name());
  if (row == kInjectableFaultCount) {
    return dialogue.refuse(dialogue.id(), v1::REFUSAL_UNKNOWN_FAULT,
                           "there is no fault '" + printable(r.name()) + "'", "name");
  }
  if (const std::string problem = problem_with(kInjectableFaults[row], r.value()); !problem.empty()) {
    return refuse_value(dialogue, r.value(), r.name() + " " + problem);
  }
  if (!is_tick(dialogue, r.at_tick(), "at_tick")) return;
  const InjectFault fault{.row = static_cast<std::uint32_t>(row), .value = r.value()};
  leases.ask(
      {.tick = static_cast<Tick>(r.at_tick()), .axis = r.axis(), .owner = dialogue.owner(), .action = fault},
      "at_tick");
}

void bump_shaft(Dialogue& dialogue, Leases& leases, const v1::ShaftBump& r) {
  if (!leases.may_change(r.axis())) return;
  if (!is_within(dialogue, r.impulse_nms(), kMaxImpulseNms, "N*m*s", "impulse_nms") ||
      !is_tick(dialogue, r.at_tick(), "at_tick")) {
    return;
  }
  leases.ask({.tick = static_cast<Tick>(r.at_tick()),
              .axis = r.axis(),
              .owner = dialogue.owner(),
              .action = ShaftBump{r.impulse_nms()}},
             "at_tick");
}

void clear_faults(Dialogue& dialogue, Leases& leases, const v1::ClearFaults& r) {
  if (!dialogue.axis_exists(r.axis())) return;
  leases.ask({.tick = 0, .axis = r.axis(), .owner = dialogue.owner(), .action = ClearFaults{}}, "axis");
}

}  // namespace drivebench
