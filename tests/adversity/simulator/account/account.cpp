#include "tests/adversity/simulator/account/account.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "plant/faults.hpp"
#include "plant/injected_faults.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::simulator {
namespace {

/// Ticks until a departure shows: the engine takes the request, its sample follows, and the I/O may run in
/// between.
constexpr Tick kTicksToGo = 3;

bool is_latched_state(std::uint64_t state) {
  return state == static_cast<std::uint64_t>(ControlState::kTimeout) ||
         state == static_cast<std::uint64_t>(ControlState::kFault);
}
/// The members of a sample that are real numbers.
constexpr auto kReals = [] {
  constexpr auto kCount =
      std::ranges::count_if(kSignals, [](const Signal& s) { return s.type == SignalType::kReal; });
  std::array<double Sample::*, kCount> reals{};
  std::size_t n = 0;
  for (const Signal& signal : kSignals)
    if (signal.type == SignalType::kReal) reals[n++] = signal.as_real;
  return reals;
}();

bool is(const Sample& s, ControlState state) {
  return s.state == static_cast<std::uint64_t>(state);
}

}  // namespace

void AxisAccount::require(bool holds, const char* promise) {
  if (!holds) broken_("axis " + std::to_string(axis_) + ": " + promise);
}

void AxisAccount::see(const Sample& s, std::uint64_t late_ticks, bool stalled) {
  // In lockstep the bench counts a refusal before the client gets it.
  require(!lockstep_ || s.refused_commands >= refusals_told_, "every refused command is counted at once");
  const bool whole = s.tick == before_.tick + 1;
  if (seen_ && stalled && !whole) {
    require(s.tick >= before_.tick, "samples come in order");
    silent_ = 0;
    skipped_ = true;
  } else if (seen_) {
    late_now_ = late_ticks != late_before_;
    require(whole, "every tick has one sample");
    require(s.late_ticks == late_ticks, "exactly the late ticks are counted");
    check_numbers(s);
    check_counters(s);
    check_state(s);
    check_owner(s);
  }
  if (!whole || s.owner != before_.owner) held_since_ = s.tick;
  seen_ = true;
  before_ = s;
  history_.add(s);
  late_before_ = late_ticks;
}

void AxisAccount::check_numbers(const Sample& s) {
  double zero = 0.0;  // zero times infinity is NaN
  for (double Sample::*member : kReals)
    zero += 0.0 * s.*member;
  if (zero == 0.0) return;
  for (const Signal& signal : kSignals) {
    if (signal.type == SignalType::kReal && !std::isfinite(s.*signal.as_real)) {
      broken_("axis " + std::to_string(axis_) + ": the state is finite: " + std::string(signal.name));
    }
  }
}

void AxisAccount::check_counters(const Sample& s) {
  require(s.refused_commands >= before_.refused_commands, "refused commands are never taken back");
  require(s.missed_commands == before_.missed_commands || s.missed_commands == before_.missed_commands + 1,
          "a tick misses one command at most");
  constexpr std::size_t kRow = find_injectable_fault("command_duplication");
  if (skipped_ || ((s.injected | before_.injected) >> kRow & 1) != 0) {
    copies_ += (s.tick - before_.tick) * static_cast<std::uint64_t>(kInjectableFaults[kRow].maximum);
  }
  require(s.refused_commands + without_lease_ <= commands_ + copies_ + scheduled_,
          "every counted refusal has a request of the controller");
  const bool missed = s.missed_commands != before_.missed_commands;
  require(!missed || !late_now_, "a late tick misses no command");
  require(!missed || is(before_, ControlState::kRun) || is(before_, ControlState::kHold) ||
              is(before_, ControlState::kReady),
          "only a commanded axis misses a command");
  if (missed) ++silent_;
  if (is(s, ControlState::kRun) || is(s, ControlState::kReady) || is(s, ControlState::kIdle)) silent_ = 0;
}

void AxisAccount::check_state(const Sample& s) {
  const std::uint64_t latched = s.faults & kLatchedFaults;
  const std::uint64_t latched_before = before_.faults & kLatchedFaults;
  require(s.state <= static_cast<std::uint64_t>(ControlState::kReady), "a state is one of the enumeration");
  require(!is_latched_state(s.state) || latched != 0, "timeout and fault have a latched bit");
  // A cleared fault may return by the end of the tick, but the state shows that it was cleared.
  const bool cleared =
      (latched_before & ~latched) != 0 || (latched_before != 0 && !is_latched_state(s.state));
  // In lockstep the answer may come before the tick runs.
  const Tick asked = static_cast<Tick>(s.tick) - 1;
  if (cleared && !clears_done_.contains(asked)) clearings_.push_back(asked);
  std::erase_if(clears_done_, [asked](Tick tick) { return tick <= asked; });
  require(!is_latched_state(before_.state) || is_latched_state(s.state) || cleared,
          "timeout and fault end only when they are cleared");
  const bool same_owner = s.owner == before_.owner;
  const bool hold = is(s, ControlState::kHold);
  require(!hold || is(before_, ControlState::kRun) || is(before_, ControlState::kHold),
          "only a driven axis can hold");
  require(!hold || late_now_ || !same_owner || s.missed_commands != before_.missed_commands,
          "an axis holds only when it misses a command");
  require((!is(s, ControlState::kRun) && !hold) || s.owner != 0, "a driven axis has an owner");
  require(!hold || (silent_ < setup_.watchdog_ticks), "the watchdog comes in time");
  const bool timed_out = (latched & ~latched_before & kCommandTimeout) != 0;
  require(!timed_out || skipped_ || silent_ >= setup_.watchdog_ticks, "the watchdog does not come too early");
  // A lease given back and taken again within a tick begins anew.
  const bool stays = same_owner && !gave_back(s.owner);
  require(!is(s, ControlState::kIdle) || !stays || cleared || is(before_, ControlState::kIdle) ||
              is(before_, ControlState::kReady) || s.owner == 0,
          "an owned axis does not become idle by itself");
}

void AxisAccount::check_owner(const Sample& s) {
  if (s.command_tick != before_.command_tick && is(s, ControlState::kRun)) {
    const auto lease = leases_.find(s.owner);
    if (lease != leases_.end()) {
      std::set<Tick>& answered = lease->second.answered;
      lease->second.renewed = std::max(lease->second.renewed, static_cast<Tick>(s.tick) - 3);
      require(s.command_tick < 0 || answered.contains(s.command_tick),
              "the owner has sent the command in force");
      answered.erase(answered.begin(), answered.lower_bound(s.command_tick));
    }
  }
  for (const Leaving& each : leaving_) {
    require(each.deadline < 0 || static_cast<Tick>(s.tick) < each.deadline || s.owner != each.owner,
            "the lease of a closed session is given back");
  }
  std::erase_if(leaving_, [&](const Leaving& each) {
    return each.deadline >= 0 && static_cast<Tick>(s.tick) >= each.deadline;
  });
  if (s.owner == before_.owner || before_.owner == 0 || by_force_.erase(s.owner) > 0) return;
  const auto lost = leases_.find(before_.owner);
  if (lost == leases_.end() || lost->second.may_go || !lost->second.is_there()) return;
  require(static_cast<Tick>(s.tick) - lost->second.renewed >= setup_.lease_ticks,
          "no client takes an axis from a connected owner");
}

void AxisAccount::io_done(Owner owner) {
  for (Leaving& each : leaving_) {
    if (each.deadline >= 0) continue;
    const auto now = static_cast<Tick>(before_.tick);
    if (each.seen < 0) each.seen = now;
    if (!each.asks || now > each.seen) each.deadline = now + kTicksToGo;
    require(!lockstep_ || owner != each.owner,
            "in lockstep the lease of a closed session is given back at once");
  }
}

void AxisAccount::granted(Owner owner, Tick tick, std::uint64_t forces, std::function<bool()> is_there) {
  Lease& lease = leases_[owner];
  lease.renewed = std::max(lease.renewed, tick);
  lease.may_go = forces_ > 0 || forces != force_changes_;
  lease.gave_back = lease.gave_back || lease.may_go;
  lease.is_there = std::move(is_there);
}

void AxisAccount::may_go(Owner owner) {
  const auto lease = leases_.find(owner);
  if (lease != leases_.end()) lease->second.may_go = lease->second.gave_back = true;
}

void AxisAccount::force_begins() {
  ++forces_;
  ++force_changes_;
  for (auto& [owner, lease] : leases_)
    lease.may_go = lease.gave_back = true;
}

void AxisAccount::may_keep(const std::string& transport, Time until) {
  Time& kept_until = kept_until_[transport];
  kept_until = std::max(kept_until, until);
}

void AxisAccount::check_quiet(const std::string& transport, Time awake) {
  require(awake <= kept_until_[transport], "a silent client does not keep an axis");
}

void AxisAccount::gone(Owner owner, bool asks) {
  leaving_.push_back({.owner = owner, .asks = asks, .gave_back = gave_back(owner)});
  leases_.erase(owner);
}

/// Whether this owner has asked for the end of its lease at some time. That of a session that is gone counts
/// until its departure shows: the samples of earlier ticks come later if the I/O stood still.
bool AxisAccount::gave_back(Owner owner) const {
  const auto lease = leases_.find(owner);
  return (lease != leases_.end() && lease->second.gave_back) ||
         std::ranges::any_of(leaving_,
                             [owner](const Leaving& each) { return each.owner == owner && each.gave_back; });
}

/// In real time the bench counts only what it takes under the lease, which may have ended on the way.
void AxisAccount::command_refused(Owner owner, std::uint64_t sent) {
  const bool was_held =
      before_.owner == owner && held_since_ <= sent && leases_.contains(owner) && !gave_back(owner);
  if (lockstep_ || was_held) ++refusals_told_;
}

void AxisAccount::command_sent(Owner owner, Tick answers) {
  ++commands_;
  const auto lease = leases_.find(owner);
  if (lease != leases_.end()) lease->second.answered.insert(answers);
}

void AxisAccount::clear_done(Owner owner, Tick tick) {
  require(leases_.contains(owner), "no client clears without a lease");
  std::erase(clearings_, tick);
  if (tick >= static_cast<Tick>(before_.tick)) clears_done_.insert(tick);
}

void AxisAccount::see_end(const Sample& s) {
  require(s.owner == 0, "without clients no axis has an owner");
  require(lockstep_ || s.refused_commands >= refusals_told_, "every refused command is counted");
  require(skipped_ || clearings_.size() <= clears_unknown_, "only the owner clears a latched fault");
}

}  // namespace drivebench::simulator
