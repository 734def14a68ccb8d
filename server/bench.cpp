#include "server/bench.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "plant/parameters.hpp"

namespace drivebench {
namespace {

class NobodyWatches final : public BenchObserver {
 public:
  void on_input(Tick, const Input&) noexcept override {}
  void on_sample(std::uint32_t, const Sample&) noexcept override {}
};

BenchObserver& nobody() {
  static NobodyWatches observer;
  return observer;
}

AxisTiming timing_of(const BenchSetup& setup) {
  return {.period_s = static_cast<double>(setup.period_ns) * 1e-9, .substeps = setup.substeps};
}

bool concerns_all_axes(const Input& input) noexcept {
  return std::holds_alternative<LateTick>(input.action) || std::holds_alternative<Overrun>(input.action);
}

}  // namespace

Bench::Bench(const BenchSetup& setup, BenchObserver* observer)
    : setup_(setup), observer_(observer != nullptr ? observer : &nobody()) {
  axes_.reserve(setup.axes.size());
  for (std::size_t i = 0; i < setup.axes.size(); ++i) {
    axes_.push_back({.axis = Axis(setup.axes[i].parameters, timing_of(setup), setup.seed, i),
                     .on_link_loss = setup.axes[i].on_link_loss,
                     .control = {},
                     .sample = {}});
    take_sample(i);
  }
}

Refused Bench::submit(const Input& input) noexcept {
  if (input.axis >= axes_.size()) return Refused::kUnknownAxis;
  if (input.tick <= tick_) {
    Input now = input;
    now.tick = tick_;
    observer_->on_input(tick_, now);
    return apply(now);
  }
  observer_->on_input(tick_, input);
  if (scheduled_ == kMaxScheduled) return Refused::kBusy;
  const auto end = schedule_.begin() + static_cast<std::ptrdiff_t>(scheduled_);
  const auto place = std::upper_bound(schedule_.begin(), end, input.tick,
                                      [](Tick tick, const PackedInput& other) { return tick < other.tick; });
  std::move_backward(place, end, end + 1);
  *place = pack(input);
  ++scheduled_;
  return Refused::kNot;
}

void Bench::apply_due() noexcept {
  std::uint64_t due = 0;
  while (due < scheduled_ && schedule_[due].tick <= tick_)
    apply(unpack(schedule_[due++]));
  if (due == 0) return;
  std::move(schedule_.begin() + static_cast<std::ptrdiff_t>(due),
            schedule_.begin() + static_cast<std::ptrdiff_t>(scheduled_), schedule_.begin());
  scheduled_ -= due;
  std::fill(schedule_.begin() + static_cast<std::ptrdiff_t>(scheduled_),
            schedule_.begin() + static_cast<std::ptrdiff_t>(scheduled_ + due), PackedInput{});
}

Refused Bench::apply(const Input& input) noexcept {
  if (!concerns_all_axes(input)) return apply_action(axes_[input.axis], input);
  late_now_ = 1;
  ++late_ticks_;
  if (std::holds_alternative<Overrun>(input.action)) {
    for (AxisRuntime& a : axes_)
      a.axis.latch(kBenchOverrun);
  }
  return Refused::kNot;
}

Refused Bench::apply_action(AxisRuntime& a, const Input& input) noexcept {
  if (const auto* command = std::get_if<Command>(&input.action)) {
    const Refused refused = accept(input.axis, *command, input.owner);
    if (refused != Refused::kNot) ++a.control.refused;
    return refused;
  }
  if (const auto* lease = std::get_if<LeaseAction>(&input.action))
    return change_lease(input.axis, *lease, input.owner);
  if (const auto* load = std::get_if<LoadChange>(&input.action)) {
    if (!std::isfinite(load->load_nm)) return Refused::kNotFinite;
    a.axis.set_load(load->load_nm, tick_, load->ramp_ticks);
  } else if (const auto* write = std::get_if<ParameterWrite>(&input.action)) {
    AxisParameters p = a.axis.parameters();
    axis_parameters()[write->row].set(p, write->value);
    a.axis.set_parameters(p);
  } else if (std::holds_alternative<RefusedCommand>(input.action)) {
    ++a.control.refused;
  } else {
    if (input.owner == 0 || input.owner != a.control.owner) return Refused::kNotOwner;
    if ((a.axis.state().faults & kLatchedFaults) == 0) return Refused::kNot;
    a.axis.clear_faults();
    a.control.state = ControlState::kIdle;
    a.control.in_force = {};
    a.control.silent_ticks = 0;
  }
  return Refused::kNot;
}

Refused Bench::would_refuse(std::size_t axis, Owner owner, const Command& command) const noexcept {
  const AxisRuntime& a = axes_[axis];
  const Control& c = a.control;
  if (owner == 0 || owner != c.owner) return Refused::kNotOwner;
  if (!std::isfinite(command.phases.voltage_v.a) || !std::isfinite(command.phases.voltage_v.b)) {
    return Refused::kNotFinite;
  }
  if (command.answers > tick_ || command.answers <= c.newest.answers) return Refused::kStale;
  return is_latched(axis) && command.phases.gates != Gates::kOff ? Refused::kLatched : Refused::kNot;
}

Refused Bench::accept(std::size_t axis, const Command& command, Owner owner) noexcept {
  Control& c = axes_[axis].control;
  const Refused why = would_refuse(axis, owner, command);
  if (why == Refused::kNot || why == Refused::kLatched) {
    c.renewed = tick_;  // a latched axis keeps its owner, who alone can clear it
  }
  if (why != Refused::kNot) return why;
  c.newest = command;
  c.fresh = 1;
  return Refused::kNot;
}

Refused Bench::change_lease(std::size_t axis, LeaseAction action, Owner owner) noexcept {
  Control& c = axes_[axis].control;
  if (owner == 0) return Refused::kNotOwner;
  if (action == LeaseAction::kAcquire) {
    if (c.owner != 0 && c.owner != owner) return Refused::kOwned;
    if (c.owner == 0) c = {.owner = owner, .renewed = tick_, .missed = c.missed, .refused = c.refused};
    c.renewed = tick_;
    return Refused::kNot;
  }
  if (owner != c.owner) return Refused::kNotOwner;
  c.renewed = tick_;
  if (action == LeaseAction::kRelease) lose_controller(axis, 0);
  if (action == LeaseAction::kLost) lose_controller(axis, kLeaseLost);
  return Refused::kNot;
}

void Bench::lose_controller(std::size_t axis, std::uint64_t fault) noexcept {
  AxisRuntime& a = axes_[axis];
  forget_scheduled(axis, a.control.owner);
  const bool was_active = a.control.state == ControlState::kRun || a.control.state == ControlState::kHold;
  if (was_active) a.axis.latch(fault);
  a.control = {.missed = a.control.missed, .refused = a.control.refused};
}

void Bench::forget_scheduled(std::size_t axis, Owner owner) noexcept {
  const auto end = schedule_.begin() + static_cast<std::ptrdiff_t>(scheduled_);
  const auto kept = std::remove_if(schedule_.begin(), end, [axis, owner](const PackedInput& input) {
    return input.axis == axis && input.owner == owner;
  });
  std::fill(kept, end, PackedInput{});
  scheduled_ = static_cast<std::uint64_t>(kept - schedule_.begin());
}

void Bench::dismiss_controllers() noexcept {
  bool dismissed = false;
  for (std::uint32_t axis = 0; axis < axes_.size(); ++axis) {
    if (owner(axis) == 0) continue;
    submit({.tick = tick_, .axis = axis, .owner = owner(axis), .action = LeaseAction::kLost});
    dismissed = true;
  }
  if (dismissed) step();
}

PhaseCommand Bench::safe_command(const AxisRuntime& a) const noexcept {
  return {.gates = a.on_link_loss == SafeAction::kFreewheel ? Gates::kOff : Gates::kZeroVoltage,
          .voltage_v = {}};
}

PhaseCommand Bench::supervise(std::size_t axis) noexcept {
  AxisRuntime& a = axes_[axis];
  Control& c = a.control;
  if (c.owner != 0 && tick_ - c.renewed >= setup_.lease_ticks) lose_controller(axis, kLeaseLost);
  if (c.fresh != 0) {
    c.silent_ticks = 0;
    c.state = ControlState::kRun;
    if (setup_.command_delay_ticks == 0) c.in_force = c.newest;
  } else if (late_now_ == 0 && (c.state == ControlState::kRun || c.state == ControlState::kHold)) {
    ++c.missed;
    ++c.silent_ticks;
    c.state = ControlState::kHold;
    if (c.silent_ticks >= setup_.watchdog_ticks) a.axis.latch(kCommandTimeout);
  }
  const std::uint64_t latched = a.axis.state().faults & kLatchedFaults;
  if (latched != 0) {
    c.state =
        (latched & ~(kCommandTimeout | kLeaseLost)) != 0 ? ControlState::kFault : ControlState::kTimeout;
    c.in_force = {};
    c.fresh = 0;
    return safe_command(a);
  }
  // With a delay the first command is accepted a tick before it is in force.
  return c.state == ControlState::kIdle || c.in_force.answers < 0 ? safe_command(a) : c.in_force.phases;
}

void Bench::step() noexcept {
  apply_due();
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const PhaseCommand command = supervise(i);
    axes_[i].axis.advance(command, tick_);
  }
  ++tick_;
  late_now_ = 0;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    take_sample(i);
    Control& c = axes_[i].control;
    if (c.fresh != 0) c.in_force = c.newest;  // what a delay of one tick has been holding back
    c.fresh = 0;
  }
}

void Bench::take_sample(std::size_t index) noexcept {
  AxisRuntime& a = axes_[index];
  const Control& c = a.control;
  const AxisSample s = a.axis.sample(tick_);
  const Tick answered = c.in_force.answers;
  a.sample = {.tick = static_cast<std::uint64_t>(tick_),
              .command_tick = answered,
              .command_age_ticks = answered < 0 ? 0 : static_cast<std::uint64_t>(tick_ - 1 - answered),
              .missed_commands = c.missed,
              .refused_commands = c.refused,
              .late_ticks = late_ticks_,
              .state = static_cast<std::uint64_t>(c.state),
              .faults = s.faults,
              .owner = c.owner,
              .encoder_count = s.encoder_count,
              .encoder_levels = s.encoder_levels,
              .edge_age_s = s.edge_age_s,
              .edge_period_s = s.edge_period_s,
              .index_count = s.index_count,
              .index_tick = s.index_tick,
              .i_a_a = s.current_a.a,
              .i_b_a = s.current_a.b,
              .u_a_v = s.voltage_v.a,
              .u_b_v = s.voltage_v.b,
              .angle_rad = s.angle_rad,
              .speed_rad_s = s.speed_rad_s,
              .torque_nm = s.torque_nm,
              .load_nm = s.load_nm,
              .true_i_a_a = s.true_current_a.a,
              .true_i_b_a = s.true_current_a.b,
              .psi_a_wb = s.rotor_flux_wb.a,
              .psi_b_wb = s.rotor_flux_wb.b,
              .bus_voltage_v = s.bus_voltage_v};
  samples_.add_block(a.sample);
  observer_->on_sample(static_cast<std::uint32_t>(index), a.sample);
}

}  // namespace drivebench
