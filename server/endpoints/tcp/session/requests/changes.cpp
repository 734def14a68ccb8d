#include "server/endpoints/tcp/session/requests/changes.hpp"

namespace drivebench {
namespace {

/// Sends the change to the bench, or the refusal to the client.
void pass_on(Dialogue& dialogue, Leases& leases, std::uint32_t axis, std::uint64_t at_tick,
             const JudgedRequest& judged, const char* field) {
  if (const auto* refused = std::get_if<RefusedRequest>(&judged)) {
    return dialogue.refuse(dialogue.id(), static_cast<v1::RefusalCode>(refused->code), refused->sentence,
                           refused->field.data());
  }
  leases.ask({.tick = static_cast<Tick>(at_tick),
              .axis = axis,
              .owner = dialogue.conducts() ? leases.sender(axis) : dialogue.owner(),
              .action = std::get<Action>(judged)},
             field);
}

}  // namespace

void write_parameter(Dialogue& dialogue, Leases& leases, const v1::WriteParameter& r) {
  if (!leases.may_change(r.axis())) return;
  Engine& engine = dialogue.engine();
  const JudgedRequest judged =
      judge_parameter(engine.change_view(r.axis()), r.name(), r.value(), r.ramp_ticks(), r.at_tick());
  const bool at_once = static_cast<Tick>(r.at_tick()) <= engine.tick();
  if (const auto* action = std::get_if<Action>(&judged); action != nullptr && at_once) {
    const auto& write = std::get<ParameterWrite>(*action);
    engine.count_as_written(r.axis(), write.row, write.value);
  }
  pass_on(dialogue, leases, r.axis(), r.at_tick(), judged, "name");
}

void set_load(Dialogue& dialogue, Leases& leases, const v1::SetLoad& r) {
  if (!leases.may_change(r.axis())) return;
  pass_on(dialogue, leases, r.axis(), r.at_tick(), judge_load(r.load_nm(), r.ramp_ticks(), r.at_tick()),
          "at_tick");
}

void inject_fault(Dialogue& dialogue, Leases& leases, const v1::InjectFault& r) {
  if (!leases.may_change(r.axis())) return;
  pass_on(dialogue, leases, r.axis(), r.at_tick(), judge_fault(r.name(), r.value(), r.at_tick()), "at_tick");
}

void bump_shaft(Dialogue& dialogue, Leases& leases, const v1::ShaftBump& r) {
  if (!leases.may_change(r.axis())) return;
  pass_on(dialogue, leases, r.axis(), r.at_tick(), judge_bump(r.impulse_nms(), r.at_tick()), "at_tick");
}

void clear_faults(Dialogue& dialogue, Leases& leases, const v1::ClearFaults& r) {
  if (!dialogue.axis_exists(r.axis())) return;
  leases.ask({.tick = 0, .axis = r.axis(), .owner = dialogue.owner(), .action = ClearFaults{}}, "axis");
}

}  // namespace drivebench
