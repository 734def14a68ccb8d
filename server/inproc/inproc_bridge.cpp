#include "server/inproc/inproc_bridge.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "plant/drive/phases.hpp"
#include "plant/math/trig.hpp"
#include "plant/parameters/parameters.hpp"
#include "server/bench/change_requests.hpp"
#include "server/bench/state_limits.hpp"

namespace drivebench {
namespace {

constexpr std::uint64_t kMagic = 0x3365'6764'7262'6264u;  // "dbbrdge3"
constexpr std::uint64_t kShortestPeriodPs = LegSetting::kShortestPeriod;
constexpr std::uint64_t kLongestPeriodPs = LegSetting::kLongestPeriod;
constexpr std::uint64_t kLongestDeadPs = LegSetting::kLongestDead;

std::uint64_t digest_of(std::span<const std::byte> bytes, std::uint64_t hash) noexcept {
  for (const std::byte byte : bytes)
    hash = (hash ^ static_cast<std::uint64_t>(byte)) * 1099511628211ULL;  // FNV-1a
  return hash;
}

template <class Mark>
std::uint64_t digest_of(const Mark& mark, std::span<const std::byte> rest) noexcept {
  return digest_of(rest, digest_of(std::as_bytes(std::span(&mark, 1)), 14695981039346656037ULL));
}

std::size_t live_count(const AxisParameters& p) noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(axis_parameters(p), &Parameter::live));
}

drivebench_bridge_edge edge_of(const GateEdge& edge) noexcept {
  return {.at_ps = static_cast<std::uint64_t>(edge.at),
          .kind = static_cast<std::uint32_t>(edge.kind),
          .channel = edge.channel,
          .level = edge.level,
          .reserved = 0};
}

/// Whether a bridge can have come to it. Within a tick the angle goes on beyond a turn.
bool is_possible_within_tick(const AxisState& axis) noexcept {
  constexpr double kLargestRad = 1e9;
  AxisState wrapped = axis;
  if (std::abs(axis.shaft.angle_rad) <= kLargestRad) wrapped.shaft.angle_rad = 0.0;
  return is_possible(wrapped);
}

/// Writes three values.
void put(double (&to)[3], const ThreePhase& x) noexcept {
  to[0] = x.a;
  to[1] = x.b;
  to[2] = x.c;
}

double turned_rad(const AxisState& state) noexcept {
  return static_cast<double>(state.turns) * kTurnRad + state.shaft.angle_rad;
}

/// The sentence about a setting that cannot be; empty: it can.
std::string problem_in_leg(const drivebench_leg& s) {
  if (s.mode > DRIVEBENCH_LEG_PWM_LOW) return "mode is " + std::to_string(s.mode) + " but must be 0 to 5";
  if (s.centred > 1) return "centred is " + std::to_string(s.centred) + " but must be 0 or 1";
  if (s.dead_ps > kLongestDeadPs) {
    return "dead_ps is " + std::to_string(s.dead_ps) + " but must be at most " +
           std::to_string(kLongestDeadPs) + " (1 ms)";
  }
  if (s.mode < DRIVEBENCH_LEG_PWM) return {};
  if (s.period_ps < kShortestPeriodPs || s.period_ps > kLongestPeriodPs) {
    return "period_ps is " + std::to_string(s.period_ps) + " but must be " +
           std::to_string(kShortestPeriodPs) + " to " + std::to_string(kLongestPeriodPs) + " (100 ns to 1 s)";
  }
  if (s.compare_ps > s.period_ps) {
    return "compare_ps is " + std::to_string(s.compare_ps) + " but must be within the period, 0 to " +
           std::to_string(s.period_ps);
  }
  if (s.period_start_ps > kLastBridgePs) {
    return "period_start_ps is " + std::to_string(s.period_start_ps) + " but must be at most " +
           std::to_string(kLastBridgePs);
  }
  return {};
}

}  // namespace

InprocBridge::Problem InprocBridge::problem_with(const BenchConfig& config, std::uint32_t axis) {
  const BenchSetup& setup = config.setup;
  if (axis >= setup.axes.size()) {
    return {DRIVEBENCH_UNKNOWN_AXIS, "axis " + std::to_string(axis) + " does not exist; the bench has " +
                                         std::to_string(setup.axes.size())};
  }
  for (std::size_t k = 0; k < setup.axes.size(); ++k) {
    const std::optional<std::size_t>& shaft = setup.axes[k].shares_shaft_with;
    const std::optional<std::size_t>& amplifier = setup.axes[k].shares_amplifier_with;
    if ((k == axis && (shaft || amplifier)) || shaft == axis || amplifier == axis) {
      return {DRIVEBENCH_NOT_AVAILABLE, "axis " + std::to_string(axis) +
                                            " shares a shaft or an amplifier with another axis: a bridge at "
                                            "gate level has one machine"};
    }
  }
  if (setup.axes[axis].parameters.drive.kind != DriveKind::kSwitched) {
    return {DRIVEBENCH_WRONG_DRIVE,
            "the drive of axis " + std::to_string(axis) +
                " has no gates: a bridge needs axis.drive.kind = \"switched_inverter\""};
  }
  if (setup.period_ns > 50'000 * setup.substeps) {
    return {DRIVEBENCH_OUT_OF_RANGE, "a step of the bench is " +
                                         std::to_string(setup.period_ns / setup.substeps) +
                                         " ns but must be at most 50000 at gate level: raise bench.substeps"};
  }
  return {DRIVEBENCH_OK, {}};
}

InprocBridge::InprocBridge(const BenchConfig& config, std::uint32_t axis)
    : parameters_(config.setup.axes[axis].parameters),
      period_ns_(config.setup.period_ns),
      substeps_(config.setup.substeps),
      seed_(config.setup.seed),
      index_(axis),
      configuration_(configuration_hash(config) + axis),
      axis_(new_axis()) {
  keep_time();
}

std::unique_ptr<GateAxis> InprocBridge::new_axis() const {
  return std::make_unique<GateAxis>(parameters_, period_ns_, substeps_, seed_, index_);
}

int InprocBridge::refuse_time(const char* name, std::uint64_t at_ps) noexcept {
  if (at_ps < now_ps()) {
    return fail(DRIVEBENCH_OUT_OF_RANGE, std::string(name) + " is " + std::to_string(at_ps) +
                                             " but time is at " + std::to_string(now_ps()) +
                                             " already and does not go back");
  }
  return fail(DRIVEBENCH_OUT_OF_RANGE, std::string(name) + " is " + std::to_string(at_ps) +
                                           " but must be at most " + std::to_string(kLastBridgePs));
}

int InprocBridge::refuse_diverged() noexcept {
  return fail(DRIVEBENCH_LATCHED,
              "the machine has diverged: its state grew beyond 1e9; restore a saved state");
}

int InprocBridge::set(std::uint32_t leg, const drivebench_leg& s) noexcept {
  if (leg >= static_cast<std::uint32_t>(axis_->legs())) {
    return fail(DRIVEBENCH_OUT_OF_RANGE, "leg is " + std::to_string(leg) + " but the machine has legs 0 to " +
                                             std::to_string(axis_->legs() - 1));
  }
  std::string problem = problem_in_leg(s);
  if (!problem.empty()) return fail(DRIVEBENCH_OUT_OF_RANGE, "leg " + std::to_string(leg) + ": " + problem);
  const bool pwm = s.mode >= DRIVEBENCH_LEG_PWM;
  axis().set_leg(leg, {.mode = static_cast<LegMode>(s.mode),
                       .centred = pwm ? s.centred : 0,
                       .period_start = pwm ? static_cast<Picoseconds>(s.period_start_ps) : 0,
                       .period = pwm ? static_cast<Picoseconds>(s.period_ps) : 0,
                       .compare = pwm ? static_cast<Picoseconds>(s.compare_ps) : 0,
                       .dead = static_cast<Picoseconds>(s.dead_ps)});
  keep_time();
  return DRIVEBENCH_OK;
}

int InprocBridge::run(std::uint64_t until_ps, std::span<drivebench_bridge_edge> edges,
                      std::size_t& count) noexcept {
  count = 0;
  if (const int code = check_time("until_ps", until_ps); code != DRIVEBENCH_OK) return code;
  const auto until = static_cast<Picoseconds>(until_ps);
  if (edges.empty()) {
    axis().run(until, {});
  } else {
    run_with(axis(), edges, until, count);
  }
  keep_time();
  return check_finite();
}

void InprocBridge::run_with(GateAxis& axis, std::span<drivebench_bridge_edge> edges, Picoseconds until,
                            std::size_t& count) noexcept {
  std::array<GateEdge, 16> some;
  while (count < edges.size()) {
    const std::span<GateEdge> room = std::span(some).first(std::min(some.size(), edges.size() - count));
    const std::size_t written = axis.run(until, room);
    for (std::size_t n = 0; n < written; ++n)
      edges[count++] = edge_of(room[n]);
    if (written < room.size()) break;
  }
}

int InprocBridge::next_edge(std::uint64_t limit_ps, drivebench_bridge_edge& edge, bool& found) noexcept {
  found = false;
  if (const int code = check_time("limit_ps", limit_ps); code != DRIVEBENCH_OK) return code;
  const std::optional<GateEdge> next = axis().next_edge(static_cast<Picoseconds>(limit_ps));
  keep_time();
  found = next.has_value();
  if (found) edge = edge_of(*next);
  return DRIVEBENCH_OK;
}

int InprocBridge::read(drivebench_bridge_state& s) noexcept {
  const GateAxis::Now now = axis().look();
  s = {.now_ps = now_ps(),
       .current_a = {},
       .terminal_v = {},
       .bus_v = now.state.drive.bus_v,
       .angle_rad = turned_rad(now.state),
       .speed_rad_s = now.state.shaft.speed_rad_s,
       .torque_nm = now.truth.torque_nm,
       .load_nm = now.truth.load_nm,
       .magnetic_j = now.truth.magnetic_j,
       .comparator_v = {},
       .comparator_levels = now.state.comparators.levels,
       .hall_lines = now.truth.hall_lines,
       .encoder_count = now.state.encoder.count,
       .legs = 0,
       .faults = now.state.faults,
       .lost_edges = axis_->lost_events()};
  put(s.current_a, now.truth.current_a);
  put(s.terminal_v, now.state.terminal_v);
  put(s.comparator_v, now.state.comparators.filtered_v);
  for (std::size_t k = 0; k < now.levels.size(); ++k) {
    const std::uint64_t level =
        now.levels[k] == LegLevel::kHigh ? 2 : (now.levels[k] == LegLevel::kLow ? 1 : 0);
    s.legs |= level << (2 * k);
  }
  return DRIVEBENCH_OK;
}

InprocBridge::Mark InprocBridge::mark_of_now() noexcept {
  const GateAxis::Now now = axis().look();
  return {.at = axis_->now(), .angle_rad = turned_rad(now.state), .sums = now.sums};
}

int InprocBridge::mark() noexcept {
  mark_ = mark_of_now();
  return DRIVEBENCH_OK;
}

int InprocBridge::mean(drivebench_bridge_means& means) noexcept {
  const Mark now = mark_of_now();
  const GateSums& a = mark_.sums;
  const GateSums& b = now.sums;
  const double time_s = 1e-12 * static_cast<double>(now.at - mark_.at);
  const double per_s = time_s > 0.0 ? 1.0 / time_s : 0.0;
  const auto difference = [per_s](double from, double to) noexcept { return (to - from) * per_s; };
  means = {.since_ps = static_cast<std::uint64_t>(mark_.at),
           .time_s = time_s,
           .current_a = {},
           .terminal_v = {},
           .bus_v = difference(a.link_vs, b.link_vs),
           .link_a = difference(a.link_as, b.link_as),
           .torque_nm = difference(a.torque_nms, b.torque_nms),
           .speed_rad_s = difference(mark_.angle_rad, now.angle_rad),
           .link_j = b.link_j - a.link_j,
           .electrical_j = b.electrical_j - a.electrical_j,
           .copper_j = b.copper_j - a.copper_j,
           .shaft_j = b.shaft_j - a.shaft_j};
  put(means.current_a, by_phase(difference, a.current_as, b.current_as));
  put(means.terminal_v, by_phase(difference, a.terminal_vs, b.terminal_vs));
  return DRIVEBENCH_OK;
}

int InprocBridge::set_load(double load_nm) noexcept {
  const JudgedRequest judged = judge_load(load_nm, 0, 0);
  if (const auto* refused = std::get_if<RefusedRequest>(&judged)) {
    return fail(static_cast<int>(refused->code), refused->sentence);
  }
  axis().set_load(load_nm);
  keep_time();
  return DRIVEBENCH_OK;
}

int InprocBridge::get_parameter(const char* name, double& value) noexcept {
  const Parameter* const row = find_parameter(axis_->parameters(), name);
  if (row == nullptr) return fail(DRIVEBENCH_UNKNOWN_PARAMETER, unknown_parameter(axis_->parameters(), name));
  value = row->get(axis_->parameters());
  return DRIVEBENCH_OK;
}

int InprocBridge::set_parameter(const char* name, double value) noexcept {
  const ChangeView view{.parameters = axis_->parameters(),
                        .shaft_of = {},
                        .amplifier_of = {},
                        .drives_another = false,
                        .tick = 0};
  const JudgedRequest judged = judge_parameter(view, name, value, 0, 0);
  if (const auto* refused = std::get_if<RefusedRequest>(&judged)) {
    return fail(static_cast<int>(refused->code), refused->sentence);
  }
  AxisParameters changed = axis_->parameters();
  find_parameter(changed, name)->set(changed, value);
  axis().set_parameters(changed);
  keep_time();
  return DRIVEBENCH_OK;
}

std::vector<double> InprocBridge::live_values() const {
  std::vector<double> values;
  for (const Parameter& row : axis_parameters(axis_->parameters())) {
    if (row.live) values.push_back(row.get(axis_->parameters()));
  }
  return values;
}

std::optional<AxisParameters> InprocBridge::with_live_values(std::span<const double> values) const {
  AxisParameters wanted = parameters_;
  std::size_t next = 0;
  for (const Parameter& row : axis_parameters(wanted)) {
    if (!row.live) continue;
    const double value = values[next++];
    if (value == row.get(wanted)) continue;
    if (breaks_a_rule(row, value)) return std::nullopt;
    row.set(wanted, value);
  }
  if (breaks_a_rule(wanted)) return std::nullopt;
  return wanted;
}

int InprocBridge::inject(const char* name, double value) noexcept {
  const JudgedRequest judged = judge_fault(name, value, 0);
  if (const auto* refused = std::get_if<RefusedRequest>(&judged)) {
    return fail(static_cast<int>(refused->code), refused->sentence);
  }
  axis().inject(find_injectable_fault(name), value);
  keep_time();
  return DRIVEBENCH_OK;
}

int InprocBridge::clear() noexcept {
  axis().clear_faults();
  keep_time();
  return DRIVEBENCH_OK;
}

int InprocBridge::save(std::vector<std::byte>& state) noexcept {
  const std::vector<double> values = live_values();
  const auto parameters = std::as_bytes(std::span(values));
  const std::vector<std::byte> axis_bytes = axis().save();
  keep_time();
  Header header{.magic = kMagic, .configuration = configuration_, .digest = 0, .mark = mark_};
  const auto head = std::as_bytes(std::span(&header, 1));
  state.resize(head.size());
  state.insert(state.end(), parameters.begin(), parameters.end());
  state.insert(state.end(), axis_bytes.begin(), axis_bytes.end());
  header.digest = digest_of(mark_, std::span(state).subspan(head.size()));
  std::ranges::copy(head, state.begin());
  return DRIVEBENCH_OK;
}

int InprocBridge::restore(std::span<const std::byte> state) noexcept {
  const auto refuse = [this](const char* why) noexcept {
    return fail(DRIVEBENCH_MALFORMED, std::string("state ") + why);
  };
  Header header;
  if (state.size() < sizeof(Header)) return refuse("is shorter than a state of a bridge");
  std::memcpy(&header, state.data(), sizeof(Header));
  if (header.magic != kMagic) return refuse("is none of a bridge");
  if (header.configuration != configuration_) return refuse("is of another bench file or axis");
  const std::span<const std::byte> rest = state.subspan(sizeof(Header));
  if (header.digest != digest_of(header.mark, rest)) return refuse("is damaged: its digest does not fit");
  std::vector<double> values(live_count(axis_->parameters()));
  const auto parameters = std::as_writable_bytes(std::span(values));
  if (rest.size() < parameters.size()) return refuse("is of another build");
  std::ranges::copy(rest.first(parameters.size()), parameters.begin());
  const std::optional<AxisParameters> wanted = with_live_values(values);
  if (!wanted) return refuse("is of another build");
  std::unique_ptr<GateAxis> restored = new_axis();
  restored->set_parameters(*wanted);
  if (!restored->restore(rest.subspan(parameters.size()), is_possible_within_tick))
    return refuse("holds what no bridge can come to");
  axis_ = std::move(restored);
  keep_time();
  mark_ = header.mark;
  return DRIVEBENCH_OK;
}

}  // namespace drivebench
