#include "clients/command/bench/describe.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

#include "clients/command/bench/bench_json.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/mode_name.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

/// A choice shows its word, and a whole number all of its digits.
std::string value_text(const v1::ParameterDescription& p) {
  const bool is_word = p.value() >= 0.0 && p.value() < p.words_size();
  if (is_word) return p.words(static_cast<int>(p.value()));
  return p.integer() ? fmt::format("{:.0f}", p.value()) : number_text(p.value());
}

std::string limits_text(double minimum, double maximum) {
  return fmt::format("{} .. {}", number_text(minimum), number_text(maximum));
}

/// The widest text of a column, its heading and two blanks included.
template <class Rows, class Text>
std::size_t column_width(std::string_view heading, const Rows& rows, Text text) {
  std::size_t width = heading.size();
  for (const auto& row : rows)
    width = std::max(width, std::string_view(text(row)).size());
  return width + 2;
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
  const auto& rows = axis.parameters();
  const std::size_t name =
      column_width("parameter", rows, [](const auto& p) { return std::string_view(p.name()); });
  const std::size_t value = column_width("value", rows, value_text);
  const std::size_t unit =
      column_width("unit", rows, [](const auto& p) { return std::string_view(p.unit()); });
  fmt::print("  {:<{}}{:>{}} {:<{}}{:>22}  {}\n", "parameter", name, "value", value, "unit", unit, "limits",
             "meaning");
  for (const v1::ParameterDescription& p : rows) {
    fmt::print("  {:<{}}{:>{}} {:<{}}{:>22}  {}{}\n", p.name(), name, value_text(p), value, p.unit(), unit,
               limits_text(p.minimum(), p.maximum()), p.live() ? "[live] " : "", p.meaning());
    if (!p.words().empty()) fmt::print("  {:<{}}{}\n", "", name + 2, words_text(p));
  }
}

void print_signals(const v1::BenchDescription& bench) {
  const std::size_t name =
      column_width("signal", bench.signals(), [](const auto& s) { return std::string_view(s.name()); });
  fmt::print("\n  {:<{}}{:<8}{:<8}{}\n", "signal", name, "unit", "kind", "meaning");
  for (const v1::SignalDescription& s : bench.signals()) {
    const char* kind = s.kind() == v1::SignalDescription::KIND_TRUTH    ? "truth"
                       : s.kind() == v1::SignalDescription::KIND_SENSOR ? "sensor"
                                                                        : "status";
    fmt::print("  {:<{}}{:<8}{:<8}{}\n", s.name(), name, s.unit(), kind, s.meaning());
  }
}

void print_injectable(const v1::BenchDescription& bench) {
  fmt::print("\n  {:<26}{:<8}{:>16}  {}\n", "injectable fault", "unit", "limits", "meaning");
  for (const v1::InjectableFaultDescription& f : bench.injectable_faults()) {
    fmt::print("  {:<26}{:<8}{:>16}  {}\n", f.name(), f.unit(), limits_text(f.minimum(), f.maximum()),
               f.meaning());
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
