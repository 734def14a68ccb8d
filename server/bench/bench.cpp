#include "server/bench/bench.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>
#include <utility>

#include "plant/parameters/parameters.hpp"

namespace drivebench {
namespace {

class NoObserver final : public BenchObserver {
 public:
  void on_input(Tick, const Input&) noexcept override {}
  void on_sample(std::uint32_t, const Sample&) noexcept override {}
};

BenchObserver& no_observer() {
  static NoObserver observer;
  return observer;
}

AxisTiming timing_of(const BenchSetup& setup) {
  return {.period_s = static_cast<double>(setup.period_ns) * 1e-9, .substeps = setup.substeps};
}

/// The drive of an axis is that of the axis whose amplifier it shares.
AxisParameters parameters_of(const BenchSetup& setup, std::size_t axis) {
  AxisParameters p = setup.axes[axis].parameters;
  if (const auto other = setup.axes[axis].shares_amplifier_with)
    p.drive = setup.axes[*other].parameters.drive;
  return p;
}

constexpr bool expects_commands(ControlState state) noexcept {
  return state == ControlState::kReady || is_driven(state);
}

}  // namespace

Bench::Bench(const BenchSetup& setup, BenchObserver* observer)
    : setup_(setup), observer_(observer != nullptr ? observer : &no_observer()) {
  axes_.reserve(setup.axes.size());
  for (std::size_t i = 0; i < setup.axes.size(); ++i) {
    const AxisSetup& axis = setup.axes[i];
    axes_.push_back({.axis = Axis(parameters_of(setup, i), timing_of(setup), setup.seed, i),
                     .on_link_loss = axis.on_link_loss,
                     .quick_stop_ticks = axis.quick_stop_ticks,
                     .rules = axis.rules,
                     .command_step = largest_step(axis.rules, setup.period_ns),
                     .shaft = axis.shares_shaft_with.value_or(i),
                     .amplifier = axis.shares_amplifier_with.value_or(i)});
    if (axis.shares_shaft_with) axes_[*axis.shares_shaft_with].shares_with = i;
    if (axis.shares_amplifier_with) axes_[*axis.shares_amplifier_with].feeds = i;
    axis_parameters(axis.parameters);  // the first use builds the table, which must not happen in a tick
    take_sample(i);
  }
}

Refused Bench::submit(const Input& input) noexcept {
  if (input.axis >= axes_.size()) return Refused::kUnknownAxis;
  const Refused why = check_sender(input, owner(input.axis), takes_voltages(input.axis));
  if (why != Refused::kNot) return why;
  const Refused shared = check_shared(input);
  return shared == Refused::kNot ? repeat(input) : shared;
}

Refused Bench::repeat(const Input& input) noexcept {
  if (input.axis >= axes_.size()) return Refused::kUnknownAxis;
  if (input.tick < tick_) {
    Input now = input;
    now.tick = tick_;
    return repeat(now);
  }
  if (input.tick == tick_) {  // as commands do: no copy of what the caller has just written
    observer_->on_input(tick_, input);
    return apply(input);
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

void Bench::await(const Trigger& trigger, const Input& input) {
  awaited_.push_back({.trigger = trigger, .input = input});
}

void Bench::submit_triggered() noexcept {
  for (AwaitedInput& awaited : awaited_) {
    TriggerState& state = awaited.state;
    if (state.triggered >= 0) continue;
    state.held = awaited.trigger.condition.holds(axes_[awaited.trigger.axis].sample) ? state.held + 1 : 0;
    if (state.held <= awaited.trigger.for_ticks) continue;
    state.triggered = tick_;
    if (only_watches_) continue;
    Input input = awaited.input;
    input.tick += tick_;
    if (repeat(input) != Refused::kNot) ++axes_[input.axis].control.refused;
  }
}

void Bench::apply_due() noexcept {
  while (due_ < scheduled_ && schedule_[due_].tick <= tick_) {
    const Input input = unpack(schedule_[due_++]);
    // The client has had its answer since the input was scheduled, so a refusal is only counted. Commands
    // count theirs.
    if (apply(input) != Refused::kNot && !std::holds_alternative<Command>(input.action)) {
      ++axes_[input.axis].control.refused;
    }
  }
  const auto end = schedule_.begin() + static_cast<std::ptrdiff_t>(scheduled_);
  const auto acted = static_cast<std::ptrdiff_t>(std::exchange(due_, 0));
  if (acted == 0) return;
  std::fill(std::move(schedule_.begin() + acted, end, schedule_.begin()), end, PackedInput{});
  scheduled_ -= static_cast<std::uint64_t>(acted);
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
    const Refused refused = accept(input.axis, *command, input.owner);  // kNotOwner: only in repeat()
    if (refused != Refused::kNot) ++a.control.refused;
    if (refused != Refused::kNot && refused != Refused::kNotOwner) {
      count_bad_command(a.control, are_bad_values(refused));
    }
    return refused;
  }
  if (const auto* lease = std::get_if<LeaseAction>(&input.action))
    return change_lease(input.axis, *lease, input.owner);
  if (const auto* load = std::get_if<LoadChange>(&input.action)) {
    if (!std::isfinite(load->load_nm)) return Refused::kNotFinite;
    if (a.multisine.is_on(Multisine::Quantity::kLoad)) a.multisine = {};
    a.axis.set_load(load->load_nm, tick_, load->ramp_ticks);
  } else if (const auto* write = std::get_if<ParameterWrite>(&input.action)) {
    return write_parameter(a, *write);
  } else if (const auto* fault = std::get_if<InjectFault>(&input.action)) {
    return inject(a, *fault);
  } else if (const auto* multisine = std::get_if<Multisine>(&input.action)) {
    return begin_multisine(a, *multisine);
  } else if (const auto* bump = std::get_if<ShaftBump>(&input.action)) {
    if (!std::isfinite(bump->impulse_nms)) return Refused::kNotFinite;
    Axis& shaft = axes_[a.shaft].axis;
    if (&shaft == &a.axis) {
      shaft.bump(bump->impulse_nms);
    } else {
      shaft.bump_output(bump->impulse_nms);
    }
  } else if (const auto* refused = std::get_if<RefusedCommand>(&input.action)) {
    ++a.control.refused;
    if (input.owner != 0 && input.owner == a.control.owner) count_bad_command(a.control, refused->bad_values);
  } else {
    return clear_faults(a, input.owner);
  }
  return Refused::kNot;
}

void Bench::count_bad_command(Control& c, bool bad_values) noexcept {
  c.good_commands = 0;
  if (bad_values) c.bad_values = 1;
}

Refused Bench::clear_faults(AxisRuntime& a, Owner owner) noexcept {
  Control& c = a.control;
  if (owner == 0 || owner != c.owner) return Refused::kNotOwner;
  const std::uint64_t faults = a.axis.state().faults & kLatchedFaults;
  if (faults == 0) return Refused::kNot;
  const double limit_a = a.axis.parameters().drive.amplifier.over_current_a;
  const bool over_current = (faults & kOverCurrentTrip) != 0 && largest_current_a(a) > limit_a;
  const double break_a = a.axis.parameters().drive.inverter.break_current_a;
  const bool pulled =
      a.axis.injected().gate_driver_fault != 0.0 || (break_a > 0.0 && largest_current_a(a) > break_a);
  const bool broken = (faults & kBreakInput) != 0 && pulled;
  if (over_current || broken || c.bad_values != 0 || a.axis.injected().command_loss != 0.0)
    return Refused::kCauseLasts;
  a.axis.clear_faults();
  if (a.feeds != 0) axes_[a.feeds].axis.clear_faults();
  c.state = ControlState::kIdle;
  c.in_force = {};
  c.silent_ticks = 0;
  c.good_commands = 0;
  c.last = {};
  return Refused::kNot;
}

CommandView Bench::command_view(std::size_t axis) const noexcept {
  const AxisRuntime& a = axes_[axis];
  return {.owner = a.control.owner,
          .tick = tick_,
          .newest = a.control.newest,
          .is_latched = is_latched(axis),
          .period_ns = setup_.period_ns,
          .step = a.command_step,
          .connection = a.axis.connection(),
          .rules = a.rules,
          .drive = a.axis.parameters().drive,
          .takes_voltages = takes_voltages(axis)};
}

void Bench::latch(AxisRuntime& a, std::uint64_t faults) noexcept {
  a.axis.latch(faults);
  if (a.feeds != 0) axes_[a.feeds].axis.latch(faults);
}

/// Of a terminal of the amplifier.
double Bench::largest_current_a(const AxisRuntime& a) const noexcept {
  const Sample none{};
  const Sample& one = a.sample;
  const Sample& other = a.feeds != 0 ? axes_[a.feeds].sample : none;
  return std::max({std::abs(one.true_i_a_a + other.true_i_a_a), std::abs(one.true_i_b_a + other.true_i_b_a),
                   std::abs(one.true_i_c_a + other.true_i_c_a)});
}

Refused Bench::accept(std::size_t axis, const Command& command, Owner owner) noexcept {
  Control& c = axes_[axis].control;
  const Refused why = judge(command, owner, command_view(axis));
  if (why == Refused::kNot || why == Refused::kLatched) {
    c.renewed = tick_;  // a latched axis keeps its owner, because no other session can clear it
  }
  if (why != Refused::kNot) return why;
  c.newest = command;
  c.fresh = 1;
  c.bad_values = 0;
  return Refused::kNot;
}

Refused Bench::change_lease(std::size_t axis, LeaseAction action, Owner owner) noexcept {
  Control& c = axes_[axis].control;
  if (owner == 0) return Refused::kNotOwner;
  if (action == LeaseAction::kAcquire) {
    if (c.owner != 0 && c.owner != owner) return Refused::kOwned;
    if (c.owner == 0) {
      c = {.owner = owner, .renewed = tick_, .last = c.last, .missed = c.missed, .refused = c.refused};
    }
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
  if (is_driven(a.control.state)) latch(a, fault);
  a.control = {.last = a.control.last, .missed = a.control.missed, .refused = a.control.refused};
}

void Bench::forget_scheduled(std::size_t axis, Owner owner) noexcept {
  const auto end = schedule_.begin() + static_cast<std::ptrdiff_t>(scheduled_);
  const auto still_to_come = schedule_.begin() + static_cast<std::ptrdiff_t>(due_);
  const auto kept = std::remove_if(still_to_come, end, [this, axis, owner](const PackedInput& input) {
    return axes_[input.axis].amplifier == axis && input.owner == owner;
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

void Bench::release_leases() noexcept {
  for (std::uint32_t axis = 0; axis < axes_.size(); ++axis) {
    const Owner holder = owner(axis);
    if (holder == 0 || takes_voltages(axis)) continue;
    submit({.tick = tick_, .axis = axis, .owner = holder, .action = LeaseAction::kRelease});
  }
}

PhaseCommand Bench::safe_command(AxisRuntime& a) noexcept {
  return act_safely(a.control.last, a.on_link_loss, a.control.state == ControlState::kFault,
                    a.axis.connection(), a.quick_stop_ticks);
}

PhaseCommand Bench::drive_with(AxisRuntime& a, const PhaseCommand& command) noexcept {
  Control& c = a.control;
  const bool slows = a.command_step > 0.0 && a.rules.on_excess == OnExcess::kSaturate;
  PhaseCommand limited = command;
  if (slows) {
    const PhaseCommand before = in_force(c.last, a.on_link_loss, a.axis.connection(), a.quick_stop_ticks);
    const LargestChange change =
        largest_change(a.command_step, command.gates, a.axis.connection(), a.axis.parameters().drive);
    if (is_steeper(before, command, change)) {
      limited = slewed(before, command, change);
      c.flags = kCommandSlewLimited;
    }
  }
  follow(c.last, limited, a.axis.connection(), a.on_link_loss == SafeAction::kQuickStop);
  return limited;
}

void Bench::take_command(Control& c) noexcept {
  c.silent_ticks = 0;
  const bool arming = c.state == ControlState::kIdle || c.state == ControlState::kReady;
  c.state = arming && ++c.good_commands < setup_.arming_commands ? ControlState::kReady : ControlState::kRun;
  if (setup_.command_delay_ticks == 0 && c.state == ControlState::kRun) c.in_force = c.newest;
}

/// Refuses the copies of a command that the injected fault of the link makes: the command itself answered the
/// tick.
void Bench::refuse_copies(AxisRuntime& a) noexcept {
  const double copies = a.axis.injected().command_duplication;
  if (copies == 0.0) return;
  a.control.refused += static_cast<std::uint64_t>(copies);
  count_bad_command(a.control, false);
}

void Bench::miss_command(AxisRuntime& a) noexcept {
  Control& c = a.control;
  ++c.silent_ticks;
  if (c.state == ControlState::kReady) {
    if (c.silent_ticks < setup_.watchdog_ticks) return;
    c.state = ControlState::kIdle;
    c.good_commands = 0;
    return;
  }
  ++c.missed;
  c.state = ControlState::kHold;
  if (c.silent_ticks >= setup_.watchdog_ticks) latch(a, kCommandTimeout);
}

PhaseCommand Bench::supervise(std::size_t axis) noexcept {
  AxisRuntime& a = axes_[axis];
  Control& c = a.control;
  c.flags = 0;
  if (c.owner != 0 && tick_ - c.renewed >= setup_.lease_ticks) lose_controller(axis, kLeaseLost);
  if (a.axis.injected().command_loss != 0.0) c.fresh = 0;  // accepted on the wire, lost before the drive
  if (c.fresh != 0) {
    take_command(c);
    refuse_copies(a);
  } else if (late_now_ == 0 && expects_commands(c.state)) {
    miss_command(a);
  }
  const std::uint64_t latched = a.axis.state().faults & kLatchedFaults;
  if (latched != 0) {
    c.state = state_with(latched);
    c.in_force = {};
    c.fresh = 0;
    c.good_commands = 0;
    return safe_command(a);
  }
  // With a delay the first command is accepted one tick before it is in force.
  return is_driven(c.state) && c.in_force.answers >= 0 ? drive_with(a, c.in_force.phases) : safe_command(a);
}

void Bench::step() noexcept {
  submit_triggered();
  apply_due();
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (axes_[i].ramps.count != 0) follow_ramps(axes_[i]);
    if (axes_[i].multisine.is_running()) follow_multisine(axes_[i]);
    if (!takes_voltages(i)) axes_[i].command = supervise(i);
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    AxisRuntime& a = axes_[i];
    if (a.shaft != i || a.amplifier != i) continue;  // advanced with its partner
    if (a.feeds != 0) {
      Axis::advance_on_one_amplifier(a.axis, axes_[a.feeds].axis, a.command, tick_);
    } else if (a.shares_with == 0) {
      a.axis.advance(a.command, tick_);
    } else {
      AxisRuntime& partner = axes_[a.shares_with];
      Axis::advance_pair(a.axis, partner.axis, a.command, partner.command, tick_);
    }
  }
  ++tick_;
  late_now_ = 0;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    take_sample(i);
    Control& c = axes_[i].control;
    // With a delay of one tick the newest command is in force from the next tick on.
    if (c.fresh != 0 && c.state == ControlState::kRun) c.in_force = c.newest;
    c.fresh = 0;
  }
}

void Bench::take_sample(std::size_t index) noexcept {
  AxisRuntime& a = axes_[index];
  const Control& c = control_of(a);
  const Tick answered = c.in_force.answers;
  ::new (&a.sample) Sample(a.axis.sample(tick_));  // made where it stays, not copied there
  a.sample.command_tick = answered;
  a.sample.command_age_ticks = answered < 0 ? 0 : static_cast<std::uint64_t>(tick_ - 1 - answered);
  a.sample.missed_commands = c.missed;
  a.sample.refused_commands = a.control.refused;  // of its own requests, too, where it shares an amplifier
  a.sample.late_ticks = late_ticks_;
  a.sample.state = static_cast<std::uint64_t>(c.state);
  a.sample.faults |= c.flags;
  a.sample.owner = c.owner;
  samples_.add_block(a.sample);
  observer_->on_sample(static_cast<std::uint32_t>(index), a.sample);
}

}  // namespace drivebench
