// Saves, restores and hashes the state of the bench. The state is a list of blocks of 8-byte words; the
// header identifies the setup, the last word is a digest of all words before it.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "plant/parameters/parameters.hpp"
#include "server/bench/bench.hpp"
#include "server/bench/state_limits.hpp"

namespace drivebench {
namespace {

constexpr std::uint64_t kMagic = 0x3474'6174'7362'7264u;  // "drbstat4"
// Far from every number of an axis, because a setup without a shared amplifier has no word for it.
constexpr std::uint64_t kSharedAmplifier = 0x1'0000'0000u;

/// The value of a parameter that hashes pass over while it is 0.
struct LaterValue {
  double value;
};

/// Calls visit(block) for the value of a row, which it may change.
template <class Visitor>
void visit_value(const Parameter& row, double& value, Visitor& visit) {
  if (!row.later) return visit(value);
  LaterValue later{value};
  visit(later);
  value = later.value;
}

}  // namespace

template <>
inline constexpr auto kLaterWords<LaterValue> = std::to_array<WordRange>({{.first = 0, .count = 1}});

namespace {

void add_setup(const BenchSetup& setup, Digest& digest) noexcept {
  digest.add(static_cast<std::uint64_t>(setup.period_ns));
  digest.add(static_cast<std::uint64_t>(setup.substeps));
  digest.add(setup.seed);
  digest.add(static_cast<std::uint64_t>(setup.command_delay_ticks));
  digest.add(static_cast<std::uint64_t>(setup.arming_commands));
  digest.add(static_cast<std::uint64_t>(setup.watchdog_ticks));
  digest.add(static_cast<std::uint64_t>(setup.lease_ticks));
  for (const AxisSetup& axis : setup.axes) {
    digest.add(static_cast<std::uint64_t>(axis.on_link_loss));
    digest.add(static_cast<std::uint64_t>(axis.quick_stop_ticks));
    digest.add(static_cast<std::uint64_t>(axis.rules.on_excess));
    digest.add(std::bit_cast<std::uint64_t>(axis.rules.slew_per_s));
    digest.add(axis.shares_shaft_with ? *axis.shares_shaft_with + 1 : 0);
    if (axis.shares_amplifier_with) digest.add(kSharedAmplifier + *axis.shares_amplifier_with);
    digest.add(axis.parameters.machine.index());
    const auto add = [&digest](const auto& block) { digest.add_block(block); };
    for (const Parameter& row : axis_parameters(axis.parameters)) {
      double value = row.get(axis.parameters);
      visit_value(row, value, add);
    }
    for (const CurveParameter& row : axis_curves(axis.parameters)) {
      const std::vector<CurvePoint>& points = row.get(axis.parameters).points();
      digest.add(points.size());
      for (const CurvePoint& point : points)
        digest.add_block(point);
    }
  }
}

/// Of every word, those that hashes pass over included.
std::uint64_t digest_of(std::span<const std::byte> words) noexcept {
  Digest digest;
  for (std::size_t at = 0; at < words.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, words.data() + at, sizeof(word));
    digest.add(word);
  }
  return digest.value();
}

}  // namespace

std::uint64_t Bench::setup_hash() const noexcept {
  Digest digest;
  add_setup(setup_, digest);
  return digest.value();
}

std::uint64_t Bench::setup_and_events_hash() const noexcept {
  Digest digest;
  add_setup(setup_, digest);
  for (const AwaitedInput& awaited : awaited_) {
    digest.add_block(pack(awaited.input));
    digest.add_block(awaited.trigger.condition);
    digest.add(awaited.trigger.axis);
    digest.add(static_cast<std::uint64_t>(awaited.trigger.for_ticks));
  }
  return digest.value();
}

template <class Self, class Visitor>
void Bench::for_each_block(Self& self, Visitor visit) {
  visit(self.tick_);
  visit(self.late_now_);
  visit(self.late_ticks_);
  visit(self.samples_);
  visit(self.scheduled_);
  visit(self.schedule_);
  for (auto& a : self.axes_) {
    visit(a.control);
    visit(a.ramps);
    visit(a.multisine);
    visit(a.sample);
    AxisState state = a.axis.state();
    visit(state);
    AxisParameters parameters = a.axis.parameters();
    for (const Parameter& row : axis_parameters(parameters)) {
      const double before = row.get(parameters);
      double value = before;
      visit_value(row, value, visit);
      if constexpr (!std::is_const_v<Self>) {
        // The limits first: a conversion to an integer is defined only within them.
        if (value == before || !breaks_a_rule(row, value)) row.set(parameters, value);
      }
    }
    if constexpr (!std::is_const_v<Self>) {
      if (is_possible(state)) a.axis.restore(state);
      if (!breaks_a_rule(parameters)) a.axis.set_parameters(parameters);
    }
  }
}

std::uint64_t Bench::state_hash() const noexcept {
  Digest digest;
  for_each_block(*this, [&digest](const auto& block) { digest.add_block(block); });
  return digest.value();
}

std::vector<std::byte> Bench::save() const {
  std::vector<std::byte> saved;
  const auto append = [&saved](const auto& block) {
    const std::size_t end = saved.size();
    saved.resize(end + sizeof(block));
    std::memcpy(saved.data() + end, &block, sizeof(block));
  };
  append(kMagic);
  append(setup_and_events_hash());
  for_each_block(*this, append);
  for (const AwaitedInput& awaited : awaited_)
    append(awaited.state);
  append(digest_of(saved));
  return saved;
}

bool Bench::restore(std::span<const std::byte> saved) {
  if (saved.size() != save().size()) return false;
  std::size_t position = saved.size() - sizeof(std::uint64_t);
  const auto take = [&](auto& block) {
    std::memcpy(&block, saved.data() + position, sizeof(block));
    position += sizeof(block);
  };
  std::uint64_t word = 0;
  take(word);
  if (word != digest_of(saved.first(saved.size() - sizeof(word)))) return false;

  position = 0;
  take(word);
  if (word != kMagic) return false;
  take(word);
  if (word != setup_and_events_hash()) return false;
  Bench restored(*this);
  for_each_block(restored, take);
  for (AwaitedInput& awaited : restored.awaited_)
    take(awaited.state);
  // What an axis cannot have has stayed out, so that a state which holds it is not the same any more.
  if (!restored.can_go_on() || !std::ranges::equal(restored.save(), saved)) return false;
  for (AxisRuntime& a : restored.axes_)
    ++a.parameter_changes;
  *this = std::move(restored);
  return true;
}

bool Bench::restore_for_holders(std::span<const std::byte> saved) {
  std::vector<Owner> holders;
  holders.reserve(axes_.size());
  for (const AxisRuntime& a : axes_)
    holders.push_back(a.control.owner);
  if (!restore(saved)) return false;
  for (std::size_t axis = 0; axis < axes_.size(); ++axis)
    hand_over(axis, holders[axis]);
  for (AxisRuntime& a : axes_)
    a.sample.owner = control_of(a).owner;
  return true;
}

/// Gives the lease of the restored state, with the inputs that its controller has scheduled, to `holder`.
void Bench::hand_over(std::size_t axis, Owner holder) noexcept {
  Control& c = axes_[axis].control;
  const Owner before = c.owner;
  if (holder == before) return;
  if (holder == 0) return lose_controller(axis, kLeaseLost);
  if (before == 0) {
    change_lease(axis, LeaseAction::kAcquire, holder);
    return;
  }
  c.owner = holder;
  for (PackedInput& input : std::span(schedule_).first(scheduled_)) {
    if (axes_[input.axis].amplifier == axis && input.owner == before) input.owner = holder;
  }
}

bool Bench::can_go_on() const noexcept {
  if (!is_possible_count(tick_) || tick_ < 0 || scheduled_ > kMaxScheduled) return false;
  if (late_now_ != 0 && late_now_ != 1) return false;
  const auto scheduled = std::span(schedule_).first(scheduled_);
  const auto may_act = [this](const PackedInput& input) {
    return input.axis < axes_.size() && is_possible_count(input.tick) && input.tick >= 0 &&
           may_be_scheduled(unpack(input).action);
  };
  return std::ranges::all_of(scheduled, may_act) &&
         std::ranges::all_of(axes_, [this](const AxisRuntime& a) { return can_go_on(a); });
}

bool Bench::can_go_on(const AxisRuntime& a) const noexcept {
  const Control& c = a.control;
  const auto is_latest = [this](Tick tick) { return tick >= -1 && tick <= tick_; };
  if (c.state > ControlState::kReady || !is_latest(c.renewed) || !is_latest(c.newest.answers) ||
      !is_latest(c.in_force.answers)) {
    return false;
  }
  const std::size_t rows = axis_parameters(a.axis.parameters()).size();
  const auto is_ramp = [rows](const ParameterRamp& r) {
    return r.row < rows && std::isfinite(r.from) && std::isfinite(r.to) && is_possible_count(r.start) &&
           is_possible_count(r.ticks) && r.start >= 0 && r.ticks >= 0;
  };
  return a.ramps.count <= kMaxRamps && std::ranges::all_of(a.ramps.ramp, is_ramp) &&
         is_possible_count(c.silent_ticks) && is_possible_count(c.good_commands) && is_possible(c.newest) &&
         is_possible(c.in_force) && is_possible(c.last) && is_possible(a.multisine) &&
         a.multisine.start <= tick_;
}

}  // namespace drivebench
