#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "plant/axis.hpp"
#include "protocols/signals/sample.hpp"
#include "server/bench/command_rules.hpp"
#include "server/bench/control.hpp"
#include "server/bench/input.hpp"
#include "server/bench/multisine.hpp"
#include "server/bench/ramps.hpp"
#include "server/bench/safe_action.hpp"

namespace drivebench {

template <>
inline constexpr auto kLaterWords<RunningMultisine> =
    std::to_array<WordRange>({{.first = 0, .count = sizeof(RunningMultisine) / 8}});

/// The settings of an axis.
struct AxisSetup {
  AxisParameters parameters;
  SafeAction on_link_loss = SafeAction::kFreewheel;
  Tick quick_stop_ticks = 4000;  ///< length of the ramp of SafeAction::kQuickStop, at most kMaxQuickStop
  CommandRules rules{};
  /// The number of an earlier axis with the same shaft: a dynamometer. The mechanics of that axis are those
  /// of both.
  std::optional<std::size_t> shares_shaft_with{};
  /// The number of an earlier axis whose amplifier drives this machine, too. Drive, commands, safe action and
  /// lease of that axis are those of both.
  std::optional<std::size_t> shares_amplifier_with{};
};

/// The settings of a bench.
struct BenchSetup {
  std::int64_t period_ns = 125'000;
  int substeps = 5;
  std::uint64_t seed = 1;
  int command_delay_ticks = 1;  ///< 0: command(k) holds from tick k; 1: from tick k+1
  /// The number of accepted commands in a row that arm an axis; the last of them drives it. A refused
  /// command, or silence for watchdog_ticks, starts the count again.
  std::int64_t arming_commands = 1;
  Tick watchdog_ticks = 20;
  Tick lease_ticks = 16'000;
  std::vector<AxisSetup> axes;
};

inline constexpr Tick kMaxQuickStop = 1'000'000;  ///< [ticks], so that the angle of the ramp has a cosine

/// A sample in a queue, with its axis.
struct TickedSample {
  TickedSample() noexcept : axis(0), sample() {}
  TickedSample(std::uint32_t of, const Sample& taken) noexcept : axis(of), sample(taken) {}
  std::uint32_t axis;
  Sample sample;
};

/// Receives each input and each sample in order, inside the tick: its methods must not wait, allocate, lock
/// or throw.
class BenchObserver {
 public:
  virtual ~BenchObserver() = default;
  /// An input arrived before tick `now` ran; it acts at input.tick, which may be later.
  virtual void on_input(Tick now, const Input& input) noexcept = 0;
  virtual void on_sample(std::uint32_t axis, const Sample& sample) noexcept = 0;
};

/// The bench: single-threaded, deterministic, without clock, thread or I/O. The same setup and the same
/// inputs at the same ticks give the same samples, bit for bit.
class Bench {
 public:
  explicit Bench(const BenchSetup& setup, BenchObserver* observer = nullptr);

  /// Takes an input. An input for a later tick waits in the schedule (at most kMaxScheduled); every other
  /// acts at the start of the current tick, and its tick is set to that. An input without the lease that it
  /// needs is no part of the run: it changes no state, and the observer does not see it.
  Refused submit(const Input& input) noexcept;
  /// Takes an input of a recording, with the lease or without: earlier builds recorded commands without the
  /// lease, and counted them in the state.
  Refused repeat(const Input& input) noexcept;

  /// Takes an input that happens once, `input.tick` ticks after its trigger: 0 in the tick whose sample it
  /// sees. The bench submits it then like an input of the configuration, so that the observer sees it and a
  /// recording repeats it. Before the first tick; allocates.
  void await(const Trigger& trigger, const Input& input);
  /// While inputs of a recording come through repeat(): conditions are watched, but what they let happen is
  /// among those inputs.
  void only_watch_triggers(bool only) noexcept { only_watches_ = only; }
  /// The tick in which the input of the n-th await() was submitted; -1: not yet.
  Tick triggered_at(std::size_t n) const noexcept { return awaited_[n].state.triggered; }

  /// Runs one tick: due inputs, commands, plant, sensors.
  void step() noexcept;

  /// The end of a run: takes every lease back and, if an axis had one, runs a tick of safe action.
  void dismiss_controllers() noexcept;

  /// Gives up every lease, as the controllers would do themselves. No tick runs.
  void release_leases() noexcept;

  /// The latched faults of an axis: with one the bench refuses commands, except those with the gates off. Its
  /// sample may be from before they came or were cleared.
  std::uint64_t latched(std::size_t axis) const noexcept {
    return axes_[axis].axis.state().faults & kLatchedFaults;
  }
  bool is_latched(std::size_t axis) const noexcept { return latched(axis) != 0; }
  /// The control state of an axis, where its sample may be from before a change.
  ControlState state(std::size_t axis) const noexcept {
    return is_latched(axis) ? state_with(latched(axis)) : control_of(axes_[axis]).state;
  }

  /// The number of parameter changes of an axis since the start of the bench.
  std::uint64_t parameter_changes(std::size_t axis) const noexcept { return axes_[axis].parameter_changes; }

  /// The view of an axis with which judge() decides on a command in the present tick.
  CommandView command_view(std::size_t axis) const noexcept;

  Tick tick() const noexcept { return tick_; }
  std::size_t axis_count() const noexcept { return axes_.size(); }
  const Sample& sample(std::size_t axis) const noexcept { return axes_[axis].sample; }
  const Axis& axis(std::size_t index) const noexcept { return axes_[index].axis; }
  /// Of the lease of the axis, or of the axis whose amplifier it shares.
  Owner owner(std::size_t axis) const noexcept { return control_of(axes_[axis]).owner; }
  /// Whether a command for the current tick has arrived.
  bool has_command(std::size_t axis) const noexcept { return control_of(axes_[axis]).fresh != 0; }

  /// A hash of the state and of every sample so far, without the inputs that wait for a trigger: a replay,
  /// which finds them among the recorded inputs, has the same hash.
  std::uint64_t state_hash() const noexcept;

  /// A hash of the setup: of all that is the same in every run of the bench, events left out.
  std::uint64_t setup_hash() const noexcept;

  /// The whole state as bytes, for restore() on a bench with the same setup, in any process.
  std::vector<std::byte> save() const;
  /// Returns false and changes nothing if the bytes are not a state that such a bench can have.
  bool restore(std::span<const std::byte> saved);
  /// The same, but leases stay with those who hold them now: the holder of an axis takes the place of the
  /// controller in the state, scheduled inputs included. Without a holder that controller has gone: an axis
  /// that it drove acts safely and latches the loss.
  bool restore_for_holders(std::span<const std::byte> saved);

  static constexpr std::size_t kMaxScheduled = 256;

 private:
  /// Whether and since when the condition of a trigger holds. 8-byte members only.
  struct TriggerState {
    Tick held = 0;  ///< samples in a row
    Tick triggered = -1;
  };
  struct AwaitedInput {
    Trigger trigger;
    Input input;
    TriggerState state{};
  };
  struct AxisRuntime {
    Axis axis;
    SafeAction on_link_loss;
    Tick quick_stop_ticks;
    CommandRules rules;
    double command_step;          ///< largest change of a set-point in a tick [V or A]; 0: no limit
    std::size_t shaft;            ///< the axis that owns the shaft: this one, or its partner before it
    std::size_t shares_with = 0;  ///< the other axis on this shaft; 0: none
    std::size_t amplifier;        ///< the axis that owns the amplifier: this one, or the one it shares
    std::size_t feeds = 0;        ///< the other axis on this amplifier; 0: none
    Control control{};
    ParameterRamps ramps{};
    RunningMultisine multisine{};
    Sample sample{};
    PhaseCommand command{};  ///< for the present tick
    std::uint64_t parameter_changes = 0;
  };

  const Control& control_of(const AxisRuntime& a) const noexcept { return axes_[a.amplifier].control; }
  bool takes_voltages(std::size_t axis) const noexcept { return axes_[axis].amplifier != axis; }
  /// The faults of both axes on an amplifier.
  void latch(AxisRuntime& a, std::uint64_t faults) noexcept;
  Refused check_shared(const Input& input) const noexcept;
  double largest_current_a(const AxisRuntime& a) const noexcept;
  Refused apply(const Input& input) noexcept;
  Refused apply_action(AxisRuntime& a, const Input& input) noexcept;
  Refused accept(std::size_t axis, const Command& command, Owner owner) noexcept;
  /// Counts a refused command of the controller.
  static void count_bad_command(Control& c, bool bad_values) noexcept;
  Refused clear_faults(AxisRuntime& a, Owner owner) noexcept;
  Refused write_parameter(AxisRuntime& a, const ParameterWrite& write) noexcept;
  /// Sets a parameter unless the value would break a rule between values.
  bool set_parameter(AxisRuntime& a, std::size_t row, double value) noexcept;
  void change_parameters(AxisRuntime& a, const AxisParameters& p) noexcept;
  void follow_ramps(AxisRuntime& a) noexcept;
  Refused begin_multisine(AxisRuntime& a, const Multisine& multisine) noexcept;
  void follow_multisine(AxisRuntime& a) noexcept;
  /// Sets the quantity of the multisine that runs.
  void excite(AxisRuntime& a, double value) noexcept;
  Refused inject(AxisRuntime& a, const InjectFault& fault) noexcept;
  Refused change_lease(std::size_t axis, LeaseAction action, Owner owner) noexcept;
  void lose_controller(std::size_t axis, std::uint64_t fault) noexcept;
  void apply_due() noexcept;
  void submit_triggered() noexcept;
  std::uint64_t setup_and_events_hash() const noexcept;
  void forget_scheduled(std::size_t axis, Owner owner) noexcept;
  PhaseCommand supervise(std::size_t axis) noexcept;
  void take_command(Control& c) noexcept;
  static void refuse_copies(AxisRuntime& a) noexcept;
  void miss_command(AxisRuntime& a) noexcept;
  PhaseCommand drive_with(AxisRuntime& a, const PhaseCommand& command) noexcept;
  void take_sample(std::size_t index) noexcept;
  void hand_over(std::size_t axis, Owner holder) noexcept;
  /// Whether a tick can go on from here: for a state that comes from bytes.
  bool can_go_on() const noexcept;
  bool can_go_on(const AxisRuntime& a) const noexcept;
  PhaseCommand safe_command(AxisRuntime& a) noexcept;

  /// Calls visit(block) for every piece of the state, each a struct of 8-byte members.
  template <class Self, class Visitor>
  static void for_each_block(Self& self, Visitor visit);

  BenchSetup setup_;
  BenchObserver* observer_;
  Tick tick_ = 0;
  std::int64_t late_now_ = 0;  ///< 1: the current tick started late
  std::uint64_t late_ticks_ = 0;
  Digest samples_;         ///< of all samples so far
  std::uint64_t due_ = 0;  ///< number of scheduled inputs that have acted in this tick; 0 between ticks
  std::uint64_t scheduled_ = 0;
  std::array<PackedInput, kMaxScheduled> schedule_{};  ///< sorted by tick, first come first served within one
  std::vector<AxisRuntime> axes_;
  std::vector<AwaitedInput> awaited_;
  bool only_watches_ = false;  ///< the inputs of awaited_ come from elsewhere
};

}  // namespace drivebench
