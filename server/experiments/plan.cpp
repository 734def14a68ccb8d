#include "server/experiments/plan.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "plant/parameters/drive_rows.hpp"
#include "plant/parameters/parameters.hpp"
#include "protocols/document.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"
#include "server/bench/change_requests.hpp"
#include "server/bench/terminals.hpp"
#include "server/experiments/plan_shapes.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMinOwner = 8;
constexpr std::size_t kMaxOwner = 100;

void check_text(std::string_view value, std::size_t most, const std::string& field) {
  if (value.size() <= most && is_plain(value)) return;
  throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, field,
                   fmt::format("{} has {} bytes but must have at most {}, without control characters or "
                               "changes of direction",
                               field, value.size(), most));
}

void check_names(const v1::RunExperiment& r) {
  if (r.owner().size() < kMinOwner || r.owner().size() > kMaxOwner) {
    throw BadRequest(
        v1::REFUSAL_OUT_OF_RANGE, "owner",
        fmt::format("owner has {} bytes but must have {} to {}", r.owner().size(), kMinOwner, kMaxOwner));
  }
  check_text(r.user(), 64, "user");
  check_text(r.label(), 100, "label");
  check_text(r.request_key(), 100, "request_key");
}

Tick length_of(const v1::RunExperiment& r, const BenchConfig& config) {
  const double period_s = static_cast<double>(config.setup.period_ns) * 1e-9;
  const char* const field = r.ticks() != 0 ? "ticks" : "duration_s";
  if (r.ticks() != 0 && r.duration_s() != 0.0) {
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "duration_s",
                     "duration_s and ticks are both given; one of them must be");
  }
  const double ticks =
      r.ticks() != 0 ? static_cast<double>(r.ticks()) : std::round(r.duration_s() / period_s);
  const double most = std::min(std::floor(config.experiments.longest_s / period_s + 0.5),
                               static_cast<double>(kMaxExperimentTicks));
  if (ticks >= 1.0 && ticks <= most) return static_cast<Tick>(ticks);
  throw BadRequest(std::isfinite(ticks) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE, field,
                   fmt::format("{} comes to {} ticks but must come to 1 to {}, {} s", field, shortest(ticks),
                               shortest(most), shortest(most * period_s)));
}

std::vector<const Signal*> signals_of(const v1::RunExperiment& r) {
  if (r.signals().empty()) {
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "signals", "signals is empty but must name one at least");
  }
  std::vector<const Signal*> signals;
  for (int i = 0; i < r.signals_size(); ++i) {
    const std::string field = fmt::format("signals[{}]", i);
    const Signal* const signal = find_signal(r.signals(i));
    if (signal == nullptr) {
      throw BadRequest(v1::REFUSAL_UNKNOWN_SIGNAL, field,
                       "there is no signal '" + printable(r.signals(i)) + "'" +
                           did_you_mean(r.signals(i), kSignals, &Signal::name));
    }
    if (std::find(signals.begin(), signals.end(), signal) != signals.end()) {
      throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, field, r.signals(i) + " is named twice");
    }
    signals.push_back(signal);
  }
  return signals;
}

/// The row of a parameter, after checking the value.
std::uint32_t row_of(const v1::NamedValue& wanted, const BenchConfig& config, std::uint32_t axis,
                     const std::string& field) {
  const AxisParameters& p = config.setup.axes[axis].parameters;
  const Parameter* const row = find_parameter(p, wanted.name());
  if (row == nullptr) {
    throw BadRequest(v1::REFUSAL_UNKNOWN_PARAMETER, field + ".name", unknown_parameter(p, wanted.name()));
  }
  if (config.setup.axes[axis].shares_shaft_with && row->name.starts_with("mechanics.")) {
    throw BadRequest(v1::REFUSAL_READ_ONLY, field + ".name",
                     wanted.name() + " belongs to the axis whose shaft this one shares");
  }
  if (config.setup.axes[axis].shares_amplifier_with && is_of_drive(row->name)) {
    throw BadRequest(v1::REFUSAL_SHARED_AMPLIFIER, field + ".name",
                     wanted.name() + " belongs to the axis whose amplifier this one shares");
  }
  if (const std::string problem = problem_with(*row, wanted.value()); !problem.empty()) {
    throw BadRequest(std::isfinite(wanted.value()) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE,
                     field + ".value", wanted.name() + " " + problem);
  }
  return static_cast<std::uint32_t>(row - axis_parameters(p).data());
}

/// The configuration with the settings, checked against all rules by reading it back like a replay.
BenchConfig with_settings(const v1::RunExperiment& r, BenchConfig config) {
  config.mode = RunMode::kFree;
  config.setup.arming_commands = 1;  // the commands of an experiment cross no link
  if (r.settings().empty()) return config;
  if (r.settings_size() > kMaxPlannedEvents) {
    throw BadRequest(
        v1::REFUSAL_OUT_OF_RANGE, "settings",
        fmt::format("there are {} settings but there may be {}", r.settings_size(), kMaxPlannedEvents));
  }
  AxisParameters& p = config.setup.axes[r.axis()].parameters;
  for (int i = 0; i < r.settings_size(); ++i) {
    const std::uint32_t row = row_of(r.settings(i), config, r.axis(), fmt::format("settings[{}]", i));
    axis_parameters(p)[row].set(p, r.settings(i).value());
  }
  try {
    static_cast<void>(parse_config(to_toml(config), "the bench with these settings", {}));
  } catch (const ConfigError& error) {
    const ConfigProblem& first = error.problems().front();
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "settings",
                     "would break a rule: " + first.key + " " + first.rule);
  }
  return config;
}

double bounded(double value, double bound, std::string_view unit, const std::string& field) {
  if (std::abs(value) <= bound) return value;
  throw BadRequest(std::isfinite(value) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE, field,
                   fmt::format("{} is {} but must lie between {} and {} {}", field, shortest(value),
                               shortest(-bound), shortest(bound), unit));
}

Tick tick_of(double time_s, double period_s, Tick most, const std::string& field) {
  const double ticks = std::round(time_s / period_s);
  if (ticks >= 0.0 && ticks <= static_cast<double>(most)) return static_cast<Tick>(ticks);
  throw BadRequest(std::isfinite(time_s) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE, field,
                   fmt::format("{} is {} but must lie between 0 and {} s", field, shortest(time_s),
                               shortest(static_cast<double>(most) * period_s)));
}

Action action_of(const v1::ExperimentEvent& e, const ExperimentPlan& plan, std::uint32_t axis, Tick ramp,
                 const std::string& field) {
  switch (e.what_case()) {
    case v1::ExperimentEvent::kLoadNm:
      return LoadChange{.load_nm = bounded(e.load_nm(), kMaxLoadNm, "N*m", field + ".load_nm"),
                        .ramp_ticks = ramp};
    case v1::ExperimentEvent::kBumpNms:
      return ShaftBump{bounded(e.bump_nms(), kMaxImpulseNms, "N*m*s", field + ".bump_nms")};
    case v1::ExperimentEvent::kParameter: {
      const std::uint32_t row = row_of(e.parameter(), plan.config, axis, field + ".parameter");
      const Parameter& parameter = axis_parameters(plan.config.setup.axes[axis].parameters)[row];
      if (!parameter.live) {
        throw BadRequest(v1::REFUSAL_READ_ONLY, field + ".parameter.name",
                         e.parameter().name() + " cannot be changed while the bench runs: settings can");
      }
      if (parameter.integer && ramp != 0) {
        throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, field + ".ramp_s",
                         "ramp_s must be 0: " + e.parameter().name() + " has no values in between");
      }
      return ParameterWrite{.row = row, .value = e.parameter().value(), .ramp_ticks = ramp};
    }
    case v1::ExperimentEvent::kFault: {
      const std::size_t row = find_injectable_fault(e.fault().name());
      if (row == kInjectableFaultCount) {
        throw BadRequest(v1::REFUSAL_UNKNOWN_FAULT, field + ".fault.name", unknown_fault(e.fault().name()));
      }
      if (const std::string problem = problem_with(kInjectableFaults[row], e.fault().value());
          !problem.empty()) {
        throw BadRequest(std::isfinite(e.fault().value()) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE,
                         field + ".fault.value", e.fault().name() + " " + problem);
      }
      if (plan.config.setup.axes[axis].shares_amplifier_with && is_of_drive(kInjectableFaults[row])) {
        throw BadRequest(v1::REFUSAL_SHARED_AMPLIFIER, field + ".fault.name",
                         e.fault().name() + " is a fault of the axis whose amplifier this one shares");
      }
      return InjectFault{.row = static_cast<std::uint32_t>(row), .value = e.fault().value()};
    }
    case v1::ExperimentEvent::WHAT_NOT_SET:
      break;
  }
  throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, field,
                   "an event must be one of load_nm, bump_nms, parameter and fault");
}

void add_events(const v1::RunExperiment& r, ExperimentPlan& plan) {
  if (r.events_size() > kMaxPlannedEvents) {
    throw BadRequest(
        v1::REFUSAL_OUT_OF_RANGE, "events",
        fmt::format("there are {} events but there may be {}", r.events_size(), kMaxPlannedEvents));
  }
  for (int i = 0; i < r.events_size(); ++i) {
    const v1::ExperimentEvent& e = r.events(i);
    const std::string field = fmt::format("events[{}]", i);
    const std::uint32_t axis = e.has_axis() ? e.axis() : plan.axis;
    if (axis >= plan.config.axes.size()) {
      throw BadRequest(
          v1::REFUSAL_UNKNOWN_AXIS, field + ".axis",
          fmt::format("axis {} does not exist; the bench has {}", axis, plan.config.axes.size()));
    }
    const Tick at = tick_of(e.at_s(), plan.period_s(), plan.ticks - 1, field + ".at_s");
    const Tick ramp = tick_of(e.ramp_s(), plan.period_s(), kMaxExperimentTicks, field + ".ramp_s");
    plan.events.push_back({.tick = at, .axis = axis, .action = action_of(e, plan, axis, ramp, field)});
  }
  std::stable_sort(plan.events.begin(), plan.events.end(),
                   [](const PlannedEvent& x, const PlannedEvent& y) { return x.tick < y.tick; });
}

/// Adds a torque impulse at tick 0 for the initial speed; a trial on a bench of the same kind gives its size.
void add_initial_speed(double speed_rad_s, ExperimentPlan& plan) {
  bounded(speed_rad_s, 1e5, "rad/s", "initial.speed_rad_s");
  if (speed_rad_s == 0.0) return;
  const std::uint32_t axis = plan.axis;
  Bench trial(plan.config.setup);
  constexpr double kTrialNms = 1e-3;
  trial.submit({.tick = 0, .axis = axis, .owner = 0, .action = ShaftBump{kTrialNms}});
  const double jump_rad_s = trial.axis(axis).sample(0).speed_rad_s;
  const double impulse_nms = kTrialNms * speed_rad_s / jump_rad_s;
  if (jump_rad_s == 0.0 || !(std::abs(impulse_nms) <= kMaxImpulseNms)) {
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "initial.speed_rad_s",
                     "initial.speed_rad_s must be 0: no impulse can turn this rotor so fast");
  }
  plan.events.insert(plan.events.begin(), {.tick = 0, .axis = axis, .action = ShaftBump{impulse_nms}});
}

void check_limit(double value, const std::string& field) {
  if (value >= 0.0 && value <= 1e9) return;
  throw BadRequest(
      std::isfinite(value) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE, field,
      fmt::format("{} is {} but must lie between 0 and 1e9; 0 is no limit", field, shortest(value)));
}

double largest_current_a(const Sample& s) noexcept {
  return std::max(
      {std::abs(s.true_i_a_a), std::abs(s.true_i_b_a), std::abs(s.true_i_c_a), std::abs(s.true_i_f_a)});
}

}  // namespace

ExperimentPlan make_plan(const v1::RunExperiment& r, const BenchConfig& config, const TableLookup& tables) {
  check_names(r);
  if (r.mode() != v1::MODE_FREE && r.mode() != v1::MODE_REALTIME) {
    throw BadRequest(v1::REFUSAL_WRONG_MODE, "mode",
                     fmt::format("mode is {} but must be {}, free, or {}, real time", int{r.mode()},
                                 int{v1::MODE_FREE}, int{v1::MODE_REALTIME}));
  }
  if (r.axis() >= config.axes.size()) {
    throw BadRequest(v1::REFUSAL_UNKNOWN_AXIS, "axis",
                     fmt::format("axis {} does not exist; the bench has {}", r.axis(), config.axes.size()));
  }
  ExperimentPlan plan;
  plan.mode = r.mode() == v1::MODE_FREE ? RunMode::kFree : RunMode::kRealtime;
  plan.axis = r.axis();
  plan.ticks = length_of(r, config);
  if (r.decimation() > plan.ticks) {
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "decimation",
                     fmt::format("decimation is {} but must not exceed the {} ticks of the experiment",
                                 r.decimation(), plan.ticks));
  }
  plan.decimation = std::max(static_cast<Tick>(r.decimation()), Tick{1});
  plan.signals = signals_of(r);
  plan.config = with_settings(r, config);
  plan.connection = terminals_of(plan.config.setup.axes[plan.axis].parameters).connection;
  add_input(r.input(), tables, plan);
  add_events(r, plan);
  add_initial_speed(r.initial().speed_rad_s(), plan);
  check_limit(r.stop().current_a(), "stop.current_a");
  check_limit(r.stop().speed_rad_s(), "stop.speed_rad_s");
  check_limit(r.stop().angle_rad(), "stop.angle_rad");
  plan.stop = r.stop();
  return plan;
}

bool is_beyond(const v1::StopLimits& stop, const Sample& s) noexcept {
  return (stop.current_a() > 0.0 && largest_current_a(s) > stop.current_a()) ||
         (stop.speed_rad_s() > 0.0 && std::abs(s.speed_rad_s) > stop.speed_rad_s()) ||
         (stop.angle_rad() > 0.0 && std::abs(s.angle_rad) > stop.angle_rad());
}

std::string broken_limit(const v1::StopLimits& stop, const Sample& s) {
  const auto sentence = [&](const char* what, double value, double limit, const char* unit) {
    return fmt::format("tick {}: the {} of {:g} {} is beyond the limit of {:g} {}", s.tick, what, value, unit,
                       limit, unit);
  };
  if (stop.current_a() > 0.0 && largest_current_a(s) > stop.current_a()) {
    return sentence("current", largest_current_a(s), stop.current_a(), "A");
  }
  if (stop.speed_rad_s() > 0.0 && std::abs(s.speed_rad_s) > stop.speed_rad_s()) {
    return sentence("speed", std::abs(s.speed_rad_s), stop.speed_rad_s(), "rad/s");
  }
  if (stop.angle_rad() > 0.0 && std::abs(s.angle_rad) > stop.angle_rad()) {
    return sentence("angle", std::abs(s.angle_rad), stop.angle_rad(), "rad");
  }
  return {};
}

}  // namespace drivebench
