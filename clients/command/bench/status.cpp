#include "clients/command/bench/status.hpp"

#include <fmt/core.h>

#include <string>

#include "clients/command/bench/bench_json.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/mode_name.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

/// Currents and voltages of the terminals that the machine has.
std::string terminals_text(const v1::Sample& s, const v1::AxisDescription& axis) {
  const std::uint32_t phases = axis.phases();
  std::string text = fmt::format("i_a {} A, ", number_text(s.i_a_a()));
  if (phases >= 2) text += fmt::format("i_b {} A, ", number_text(s.i_b_a()));
  if (phases >= 3) text += fmt::format("i_c {} A, ", number_text(s.i_c_a()));
  if (axis.field_winding()) text += fmt::format("i_f {} A, ", number_text(s.i_f_a()));
  text += fmt::format("u_a {} V, ", number_text(s.u_a_v()));
  if (phases >= 2) text += fmt::format("u_b {} V, ", number_text(s.u_b_v()));
  if (phases >= 3) text += fmt::format("u_c {} V, ", number_text(s.u_c_v()));
  if (axis.field_winding()) text += fmt::format("u_f {} V, ", number_text(s.u_f_v()));
  return text;
}

}  // namespace

int run_status(const StatusOptions& options) {
  link::Link bench_link = open_link(options.link, "status");
  const v1::BenchDescription& bench = bench_link.welcome().bench();
  const v1::Status& status = bench_link.status();
  if (options.json) {
    fmt::print("{}\n", status_json(status, bench));
    return kExitOk;
  }
  v1::AxisDescription unknown;
  unknown.set_name("?");
  unknown.set_phases(3);
  fmt::print("bench {} at {}: {}, tick {} ({:.3f} s), {} session{}\n", bench.name(), bench_link.peer(),
             link::name_of(status.mode()), status.tick(),
             static_cast<double>(status.tick()) * bench.period_s(), status.sessions(),
             status.sessions() == 1 ? "" : "s");
  if (status.mode() == v1::MODE_REALTIME) {
    fmt::print("late ticks {}, worst lateness {:.1f} us\n", status.late_ticks(),
               status.worst_lateness_s() * 1e6);
  }
  if (status.state_hash() != 0) fmt::print("state hash {:016x}\n", status.state_hash());
  if (status.recording().empty() && status.recording_gaps() == 0) {
    fmt::print("not recording\n");
  } else {
    fmt::print("recording {}, {} gaps{}\n", status.recording().empty() ? "is gone" : status.recording(),
               status.recording_gaps(), status.recording_over() ? "; it has ended, see the notes" : "");
  }
  for (const v1::AxisSample& each : status.axes()) {
    const v1::Sample& s = each.sample();
    const auto i = static_cast<int>(each.axis());
    const v1::AxisDescription& axis = i < bench.axes_size() ? bench.axes(i) : unknown;
    fmt::print("axis {} ({}): {}, owner {}, faults {}{}{}\n", i, axis.name(), name_of_state(s.state()),
               s.owner() == 0 ? "none" : fmt::format("{}", s.owner()), fault_names(bench, s.faults()),
               s.injected() == 0 ? "" : ", injected ",
               s.injected() == 0 ? "" : injected_names(bench, s.injected()));
    if (const std::uint64_t latched = latched_faults(bench, s.faults()); latched != 0) {
      fmt::print(
          "  latched: {}; no command is executed before `drivebench clear {}`, or `--clear` of a "
          "controller\n",
          fault_names(bench, latched), i);
    }
    fmt::print("  count {}, {}speed {} rad/s, load {} N*m\n", s.encoder_count(), terminals_text(s, axis),
               number_text(s.speed_rad_s()), number_text(s.load_nm()));
    fmt::print("  missed commands {}, refused commands {}\n", s.missed_commands(), s.refused_commands());
  }
  for (const v1::TransportStatus& transport : status.transports()) {
    fmt::print("{}: {}\n ", transport.name(), transport.state());
    for (const v1::TransportStatus::Count& count : transport.counts()) {
      if (count.value() > 0) fmt::print(" {} {},", count.name(), count.value());
    }
    fmt::print(" all else 0\n");
  }
  for (const std::string& note : status.notes())
    fmt::print("note: {}\n", note);
  return kExitOk;
}

}  // namespace drivebench::command
