#include "clients/command/bench/change.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "clients/command/bench/bench_json.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/common/session/session.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

/// The axis whose lease is that of this one: itself, or the one whose amplifier it shares.
std::uint32_t leased_axis(const v1::BenchDescription& bench, std::uint32_t number) {
  const std::string& shared = bench.axes(static_cast<int>(number)).shares_amplifier_with();
  return shared.empty() ? number : axis_number(bench, shared);
}

/// An open link and the lease of the chosen axis: only its owner and a conductor may change an axis. A free
/// run has no owners.
class HeldAxis {
 public:
  HeldAxis(const LinkChoice& choice, std::string_view axis, std::string_view subcommand)
      : link_(open_link(choice, subcommand)),
        number_(axis_number(link_.welcome().bench(), axis)),
        leased_(leased_axis(link_.welcome().bench(), number_)),
        holds_(!choice.conducts && link_.welcome().bench().mode() != v1::MODE_FREE) {
    if (holds_) link_.acquire(leased_);
  }
  ~HeldAxis() {
    try {
      if (holds_) link_.release(leased_);
    } catch (const std::exception&) {
      return;  // the end of the session gives it back
    }
  }
  HeldAxis(const HeldAxis&) = delete;
  HeldAxis& operator=(const HeldAxis&) = delete;

  link::Link& link() noexcept { return link_; }
  std::uint32_t number() const noexcept { return number_; }
  const v1::BenchDescription& bench() const noexcept { return link_.welcome().bench(); }
  const v1::AxisDescription& description() const { return bench().axes(static_cast<int>(number_)); }

 private:
  link::Link link_;
  std::uint32_t number_;
  std::uint32_t leased_;
  bool holds_;
};

/// A value that a user asks for.
struct Wanted {
  double value;
  const std::string& written;  ///< as the user wrote it
};

/// `5.85 ohm`; `phase 2` where the value is the number of a thing.
std::string with_unit(const Wanted& wanted, std::string_view unit) {
  constexpr auto kThings = std::to_array<std::string_view>({"phase", "pair", "line", "winding"});
  if (unit.empty() || unit == "1") return wanted.written;
  if (std::ranges::count(kThings, unit) == 0) return fmt::format("{} {}", wanted.written, unit);
  return wanted.value == 0.0 ? wanted.written : fmt::format("{} {}", unit, wanted.written);
}

void tell(bool json, HeldAxis& axis, std::string_view name, const Wanted& wanted, std::string_view unit,
          std::uint64_t tick) {
  if (json) {
    fmt::print("{}\n", change_json(axis.number(), name, wanted.value, tick));
  } else {
    fmt::print("axis {} ({}): {} = {} from tick {} on\n", axis.number(), axis.description().name(), name,
               printable(with_unit(wanted, unit)), tick);
  }
}

/// The tick that the bench answers to a request; its refusal has the value as the user wrote it.
template <class Request>
std::uint64_t asked_of(const Wanted& wanted, Request request) {
  try {
    return request();
  } catch (const link::RefusalError& refused) {
    link::refuse(refused.code(), as_written(refused.what(), wanted.value, printable(wanted.written)),
                 refused.field());
  }
}

bool is_switch(const v1::ParameterDescription& row) {
  return row.integer() && row.words().empty() && row.minimum() == 0.0 && row.maximum() == 1.0;
}

/// A number, one of the words of a choice, or of a switch true or false, as bench files write it.
double value_of(const v1::ParameterDescription& row, const std::string& text) {
  if (const auto value = finite_number(text)) return *value;
  if (is_switch(row)) {
    if (text == "true") return 1.0;
    if (text == "false") return 0.0;
    throw UsageError(fmt::format("'{}' is not true or false for {}", printable(text), row.name()));
  }
  const auto word = std::find(row.words().begin(), row.words().end(), text);
  if (word != row.words().end()) return static_cast<double>(word - row.words().begin());
  throw UsageError(fmt::format("'{}' is not {} {}{}", printable(text),
                               row.words().empty() ? "a number for" : "a value of", row.name(),
                               row.words().empty() ? "" : advice(text, row.words())));
}

}  // namespace

int run_inject(const InjectOptions& options) {
  HeldAxis axis(options.link, options.axis, "inject");
  const auto& faults = axis.bench().injectable_faults();
  const auto fault = std::find_if(faults.begin(), faults.end(),
                                  [&](const auto& each) { return each.name() == options.fault; });
  if (fault == faults.end()) {
    throw UsageError(fmt::format("no fault '{}'{}; `drivebench describe` lists them",
                                 printable(options.fault),
                                 did_you_mean(options.fault, faults, &v1::InjectableFaultDescription::name)));
  }
  const Wanted wanted = {.value = std::strtod(options.value.c_str(), nullptr), .written = options.value};
  const std::uint64_t tick = asked_of(wanted, [&] {
    return axis.link().inject_fault(axis.number(), {.name = options.fault, .value = wanted.value});
  });
  tell(options.json, axis, options.fault, wanted, fault->unit(), tick);
  return kExitOk;
}

int run_set(const SetOptions& options) {
  HeldAxis axis(options.link, options.axis, "set");
  const auto& rows = axis.description().parameters();
  const auto row =
      std::find_if(rows.begin(), rows.end(), [&](const auto& each) { return each.name() == options.name; });
  if (row == rows.end()) {
    throw UsageError(fmt::format("no parameter '{}'{}; `drivebench describe` lists them",
                                 printable(options.name),
                                 did_you_mean(options.name, rows, &v1::ParameterDescription::name)));
  }
  const Wanted wanted = {.value = value_of(*row, options.value), .written = options.value};
  const double ticks = std::round(options.ramp_s / axis.bench().period_s());
  if (ticks > 0x1p53) throw UsageError(fmt::format("--ramp-s {:g} is too long", options.ramp_s));
  const auto ramp_ticks = static_cast<std::uint64_t>(ticks);
  const std::uint64_t tick = asked_of(wanted, [&] {
    return axis.link().write_parameter(
        axis.number(), {.name = options.name, .value = wanted.value, .ramp_ticks = ramp_ticks});
  });
  tell(options.json, axis, options.name, wanted, row->unit(), tick + ramp_ticks);
  return kExitOk;
}

int run_clear(const ClearOptions& options) {
  HeldAxis axis(options.link, options.axis, "clear");
  const v1::Sample newest = axis.link().status().axes(static_cast<int>(axis.number())).sample();
  const std::uint64_t latched = latched_faults(axis.bench(), newest.faults());
  const std::uint64_t tick = axis.link().clear_faults(axis.number());
  if (options.json) {
    fmt::print("{}\n", clear_json(axis.bench(), axis.number(), latched, tick));
  } else {
    fmt::print("axis {} ({}): cleared{} at tick {}\n", axis.number(), axis.description().name(),
               latched == 0 ? ", no latched fault showed," : " " + fault_names(axis.bench(), latched), tick);
  }
  return kExitOk;
}

int run_take(const TakeOptions& options) {
  if (!options.force) {
    throw UsageError(
        "take needs --force: the session that holds the axis loses it, and the axis goes to its safe action");
  }
  link::Link link = open_link(options.link, "take");
  const std::uint32_t axis = axis_number(link.welcome().bench(), options.axis);
  const std::uint64_t owner = link.take(axis, options.reason);
  const std::uint64_t tick = link.status().tick();
  link.release(axis);
  if (options.json) {
    fmt::print("{}\n", change_json(axis, "take", static_cast<double>(owner), tick));
  } else {
    fmt::print(
        "axis {} ({}): taken and free again since tick {}; its next controller may have to clear a fault\n",
        axis, link.welcome().bench().axes(static_cast<int>(axis)).name(), tick);
  }
  return kExitOk;
}

int run_bump(const BumpOptions& options) {
  HeldAxis axis(options.link, options.axis, "bump");
  const Wanted wanted = {.value = std::strtod(options.impulse_nms.c_str(), nullptr),
                         .written = options.impulse_nms};
  const std::uint64_t tick =
      asked_of(wanted, [&] { return axis.link().bump_shaft(axis.number(), wanted.value); });
  tell(options.json, axis, "bump", wanted, "N*m*s", tick);
  return kExitOk;
}

}  // namespace drivebench::command
