#include "clients/command/bench/describe.hpp"

#include <fmt/core.h>

#include <cstdio>
#include <string>

#include "clients/command/bench/bench_json.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/mode_name.hpp"

namespace drivebench::command {
namespace {

/// A choice shows its word.
std::string value_text(const v1::ParameterDescription& p) {
  const bool is_word = p.value() >= 0.0 && p.value() < p.words_size();
  return is_word ? p.words(static_cast<int>(p.value())) : fmt::format("{:.6g}", p.value());
}

std::string words_text(const v1::ParameterDescription& p) {
  std::string text;
  for (int i = 0; i < p.words_size(); ++i)
    text += fmt::format("{}{} {}", i == 0 ? "" : ", ", i, p.words(i));
  return text;
}

void print_axis(int number, const v1::AxisDescription& axis) {
  fmt::print("\naxis {} ({}): {}\n", number, axis.name(), axis.machine());
  fmt::print("  machine {}, {} phase{} ({}){}, drive {}{}{}{}{}\n", axis.machine_kind(), axis.phases(),
             axis.phases() == 1 ? "" : "s", axis.connection(),
             axis.field_winding() ? " and a field winding" : "", axis.drive_kind(),
             axis.shares_shaft_with().empty() ? "" : ", on the shaft of ", axis.shares_shaft_with(),
             axis.shares_amplifier_with().empty() ? "" : ", on the amplifier of ",
             axis.shares_amplifier_with());
}

void print_parameters(const v1::AxisDescription& axis) {
  fmt::print("  {:<36}{:>12} {:<11}{:>22}  {}\n", "parameter", "value", "unit", "limits", "meaning");
  for (const v1::ParameterDescription& p : axis.parameters()) {
    fmt::print("  {:<36}{:>12} {:<11}{:>22}  {}{}\n", p.name(), value_text(p), p.unit(),
               fmt::format("{:g} .. {:g}", p.minimum(), p.maximum()), p.live() ? "[live] " : "", p.meaning());
    if (!p.words().empty()) fmt::print("  {:<38}{}\n", "", words_text(p));
  }
}

void print_signals(const v1::BenchDescription& bench) {
  fmt::print("\n  {:<20}{:<8}{:<8}{}\n", "signal", "unit", "kind", "meaning");
  for (const v1::SignalDescription& s : bench.signals()) {
    const char* kind = s.kind() == v1::SignalDescription::KIND_TRUTH    ? "truth"
                       : s.kind() == v1::SignalDescription::KIND_SENSOR ? "sensor"
                                                                        : "status";
    fmt::print("  {:<20}{:<8}{:<8}{}\n", s.name(), s.unit(), kind, s.meaning());
  }
}

void print_injectable(const v1::BenchDescription& bench) {
  fmt::print("\n  {:<26}{:<8}{:>16}  {}\n", "injectable fault", "unit", "limits", "meaning");
  for (const v1::InjectableFaultDescription& f : bench.injectable_faults()) {
    fmt::print("  {:<26}{:<8}{:>16}  {}\n", f.name(), f.unit(),
               fmt::format("{:g} .. {:g}", f.minimum(), f.maximum()), f.meaning());
  }
}

}  // namespace

int run_describe(const DescribeOptions& options) {
  const link::Link bench_link = open_link(options.link, "describe");
  const v1::Welcome& welcome = bench_link.welcome();
  if (options.json) {
    fmt::print("{}\n", describe_json(welcome));
    return kExitOk;
  }
  const v1::BenchDescription& bench = welcome.bench();
  fmt::print("bench {} at {}, {}, build {}\n", bench.name(), bench_link.peer(), link::name_of(bench.mode()),
             welcome.build_id());
  fmt::print(
      "period {:g} us ({:g} kHz), {} substeps, command delay {} tick{}, watchdog {} ticks, lease {:g} s\n",
      bench.period_s() * 1e6, 1e-3 / bench.period_s(), bench.substeps(), bench.command_delay_ticks(),
      bench.command_delay_ticks() == 1 ? "" : "s", bench.watchdog_ticks(), bench.lease_s());
  fmt::print("seed {}, configuration {:016x}\n", bench.seed(), bench.configuration_hash());
  for (int i = 0; i < bench.axes_size(); ++i) {
    print_axis(i, bench.axes(i));
    print_parameters(bench.axes(i));
  }
  print_signals(bench);
  fmt::print("\n  {:<26}{}\n", "fault", "meaning");
  for (const v1::FaultDescription& f : bench.faults())
    fmt::print("  {:<26}{}\n", f.name(), f.meaning());
  print_injectable(bench);
  return kExitOk;
}

}  // namespace drivebench::command
