#include "server/inproc/inproc_bench.hpp"

#include <algorithm>
#include <utility>

#include "plant/parameters/parameters.hpp"
#include "protocols/abi/edges.hpp"
#include "protocols/leg_edges.hpp"
#include "protocols/text.hpp"
#include "server/bench/change_requests.hpp"
#include "server/bench/state_limits.hpp"
#include "server/config/sections/plausible.hpp"

namespace drivebench {
namespace {

Command command_of(const drivebench_command& c) noexcept {
  return {
      .answers = static_cast<Tick>(c.tick),
      .phases = {.gates = static_cast<Gates>(c.gates),
                 .legs_off = static_cast<std::uint32_t>(c.legs_off),
                 .setpoint = {.a = c.setpoint_a, .b = c.setpoint_b, .c = c.setpoint_c, .field = c.setpoint_f},
                 .edges = c.gates == DRIVEBENCH_GATES_EDGES ? leg_edges(abi::edges_of(c)) : LegEdges{}}};
}

std::string on_axis(std::uint32_t axis) {
  return " (axis " + std::to_string(axis) + ")";
}

BenchConfig in_lockstep(BenchConfig config) {
  change_mode(config, RunMode::kLockstep);
  return config;
}

}  // namespace

BenchConfig load_inproc_config(const std::filesystem::path& bench_file) {
  std::vector<ConfigProblem> odd;
  BenchConfig config = load_config(bench_file, odd);
  if (!odd.empty()) throw ConfigError(std::move(odd));
  return config;
}

InprocBench::InprocBench(const BenchConfig& config) : config_(in_lockstep(config)), bench_(config_.setup) {
  schedule_events(config_, bench_);
  start_ = bench_.save();
  describe_bench();
}

int InprocBench::fail_with(Refused why, std::uint32_t axis, std::string field, std::string more) noexcept {
  return fail(static_cast<int>(refusal_row(why).tcp),
              sentence_of(why, config_, axis, bench_.latched(axis)) + more, std::move(field));
}

int InprocBench::check_axis(std::uint32_t axis) noexcept {
  if (axis < bench_.axis_count()) return DRIVEBENCH_OK;
  return fail(DRIVEBENCH_UNKNOWN_AXIS,
              "axis " + std::to_string(axis) + " does not exist; the bench has " +
                  std::to_string(bench_.axis_count()),
              "axis");
}

int InprocBench::submit(std::uint32_t axis, std::uint64_t at_tick, const JudgedRequest& judged,
                        const char* field) noexcept {
  if (const auto* refused = std::get_if<RefusedRequest>(&judged)) {
    return fail(static_cast<int>(refused->code), refused->sentence, std::string(refused->field));
  }
  const Refused why = bench_.submit({.tick = static_cast<Tick>(at_tick),
                                     .axis = axis,
                                     .owner = kOwner,
                                     .action = std::get<Action>(judged)});
  return why == Refused::kNot ? DRIVEBENCH_OK : fail_with(why, axis, field);
}

int InprocBench::lease(std::uint32_t axis, LeaseAction action) noexcept {
  const int code = check_axis(axis);
  return code == DRIVEBENCH_OK ? submit(axis, 0, Action(action), "axis") : code;
}

int InprocBench::clear(std::uint32_t axis) noexcept {
  const int code = check_axis(axis);
  return code == DRIVEBENCH_OK ? submit(axis, 0, Action(ClearFaults{}), "axis") : code;
}

int InprocBench::check_commands(std::span<const drivebench_command> commands) noexcept {
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const drivebench_command& c = commands[i];
    if (const int code = check_axis(c.axis); code != DRIVEBENCH_OK) return code;
    const auto same = [&c](const drivebench_command& other) { return other.axis == c.axis; };
    if (std::ranges::any_of(commands.first(i), same)) {
      return fail(DRIVEBENCH_OUT_OF_RANGE, "two commands for one axis", "commands.axis");
    }
    if (c.gates > DRIVEBENCH_GATES_EDGES) {
      return fail(DRIVEBENCH_OUT_OF_RANGE, "gates is " + std::to_string(c.gates) + " but must be 0 to 5",
                  "commands.gates");
    }
    if (c.legs_off > kAllLegs) {
      return fail(DRIVEBENCH_OUT_OF_RANGE,
                  "legs_off is " + std::to_string(c.legs_off) + " but must be 0 to 7", "commands.legs_off");
    }
    if (c.gates == DRIVEBENCH_GATES_EDGES) {
      EdgeProblem problem = problem_with(abi::edges_of(c), config_.setup.period_ns);
      if (!problem.sentence.empty()) {
        return fail(DRIVEBENCH_OUT_OF_RANGE, std::move(problem.sentence), std::move(problem.field));
      }
    }
  }
  // A server would wait for the other controllers; here there is none.
  for (std::uint32_t axis = 0; axis < bench_.axis_count(); ++axis) {
    const bool waits = bench_.owner(axis) != 0 && !bench_.is_latched(axis) &&
                       !config_.setup.axes[axis].shares_amplifier_with &&
                       std::ranges::none_of(commands, [axis](const auto& c) { return c.axis == axis; });
    if (waits) {
      return fail(DRIVEBENCH_BUSY,
                  "the tick also waits for a command of axis " + std::to_string(axis) +
                      ", whose lease this program holds: give all commands in one step",
                  "commands");
    }
  }
  return DRIVEBENCH_OK;
}

int InprocBench::give(const drivebench_command& c) noexcept {
  const Refused why =
      bench_.submit({.tick = bench_.tick(), .axis = c.axis, .owner = kOwner, .action = command_of(c)});
  if (why == Refused::kNot) return DRIVEBENCH_OK;
  return fail_with(why, c.axis, why == Refused::kWrongDrive ? "commands.gates" : "commands", on_axis(c.axis));
}

int InprocBench::step(std::span<const drivebench_command> commands) noexcept {
  if (const int code = check_commands(commands); code != DRIVEBENCH_OK) return code;
  if (commands.size() > 1) {  // all or none: the first one that is refused is given alone, so that it counts
    const auto refused = std::ranges::find_if(commands, [this](const drivebench_command& c) {
      return judge(command_of(c), kOwner, bench_.command_view(c.axis)) != Refused::kNot;
    });
    if (refused != commands.end()) return give(*refused);
  }
  for (const drivebench_command& c : commands) {
    if (const int code = give(c); code != DRIVEBENCH_OK) return code;
  }
  bench_.step();
  return DRIVEBENCH_OK;
}

int InprocBench::check_owner(std::uint32_t axis) noexcept {
  if (const int code = check_axis(axis); code != DRIVEBENCH_OK) return code;
  return bench_.owner(axis) == kOwner ? DRIVEBENCH_OK : fail_with(Refused::kNotOwner, axis, "axis");
}

ChangeView InprocBench::change_view(std::uint32_t axis) const noexcept {
  return drivebench::change_view(config_, axis, bench_.axis(axis).parameters(), bench_.tick());
}

int InprocBench::get(std::uint32_t axis, const char* name, double& value) noexcept {
  if (const int code = check_axis(axis); code != DRIVEBENCH_OK) return code;
  const AxisParameters& p = bench_.axis(axis).parameters();
  const Parameter* const row = find_parameter(p, name);
  if (row == nullptr) {
    return fail(DRIVEBENCH_UNKNOWN_PARAMETER, unknown_parameter(p, name), "names");
  }
  value = row->get(p);
  return DRIVEBENCH_OK;
}

int InprocBench::set(std::uint32_t axis, const char* name, double value, std::uint64_t ramp_ticks,
                     std::uint64_t at_tick) noexcept {
  if (const int code = check_owner(axis); code != DRIVEBENCH_OK) return code;
  return submit(axis, at_tick, judge_parameter(change_view(axis), name, value, ramp_ticks, at_tick), "name");
}

int InprocBench::set_load(std::uint32_t axis, double load_nm, std::uint64_t ramp_ticks,
                          std::uint64_t at_tick) noexcept {
  if (const int code = check_owner(axis); code != DRIVEBENCH_OK) return code;
  return submit(axis, at_tick, judge_load(load_nm, ramp_ticks, at_tick), "at_tick");
}

int InprocBench::inject(std::uint32_t axis, const char* name, double value, std::uint64_t at_tick) noexcept {
  if (const int code = check_owner(axis); code != DRIVEBENCH_OK) return code;
  return submit(axis, at_tick, judge_fault(name, value, at_tick), "at_tick");
}

int InprocBench::bump(std::uint32_t axis, double impulse_nms, std::uint64_t at_tick) noexcept {
  if (const int code = check_owner(axis); code != DRIVEBENCH_OK) return code;
  return submit(axis, at_tick, judge_bump(impulse_nms, at_tick), "at_tick");
}

int InprocBench::event_tick(std::size_t event, std::int64_t& tick) noexcept {
  tick = event_states(config_, bench_)[event].acted.value_or(-1);
  return DRIVEBENCH_OK;
}

int InprocBench::state_hash(std::uint64_t& hash) noexcept {
  hash = bench_.state_hash();
  return DRIVEBENCH_OK;
}

int InprocBench::save(std::vector<std::byte>& state) noexcept {
  state = bench_.save();
  return DRIVEBENCH_OK;
}

int InprocBench::restore(std::span<const std::byte> state) noexcept {
  if (state.size() > start_.size()) {
    return fail(DRIVEBENCH_OUT_OF_RANGE, longer_than_a_state(start_.size()), "state");
  }
  if (bench_.restore_for_holders(state)) return DRIVEBENCH_OK;
  return fail(DRIVEBENCH_MALFORMED, no_state(state.size()), "state");
}

}  // namespace drivebench
