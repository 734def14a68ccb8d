#include "clients/command/regression/cases/reference_run.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <string>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/control/control_presets.hpp"
#include "clients/command/regression/cases/run_case.hpp"

namespace drivebench::command {
namespace {

using regression::Case;
using regression::CheckSpec;
using regression::DeviceUnderTest;

bool has_reference(const CheckSpec& check) noexcept {
  return !check.reference.empty();
}

/// The case with a preset in the place of its device.
Case driven_by(const Case& c, const std::string& preset) {
  Case other = c;
  other.device = DeviceUnderTest();
  other.device.kind = DeviceUnderTest::Kind::kPreset;
  other.device.preset = preset;
  other.device.axis = c.device.axis;
  return other;
}

/// Runs the preset, and gives its run to every tube around it.
void run(const PreparedCase& prepared, const std::string& preset, std::vector<CheckSpec>& checks) {
  struct Watched {
    CheckSpec* check;
    std::size_t axis;
    std::shared_ptr<regression::Golden> run;
  };
  std::vector<Watched> watched;
  for (CheckSpec& check : checks) {
    if (check.reference != preset) continue;
    watched.push_back(
        {&check, find_axis(prepared.facts, check.axis), std::make_shared<regression::Golden>()});
    check.reference_run = watched.back().run;
  }
  const Case reference = driven_by(*prepared.what, preset);
  InprocAxis axis(prepared.bench_file.string(), reference.device.axis);
  const auto see = [&] {
    for (const Watched& each : watched) {
      const Sample& sample = axis.all()[each.axis];
      each.run->ticks.push_back(sample.tick);
      each.run->values.push_back(value_of(*each.check->signal, sample));
    }
  };
  drive(axis, reference, see, {.end_tick = prepared.facts.end_tick, .repeats = std::nullopt});
}

}  // namespace

ReferencedCase::ReferencedCase(const PreparedCase& prepared)
    : prepared_(prepared), what_{.name = {}, .file = {}, .bench = {}} {
  if (std::ranges::none_of(prepared.what->checks, has_reference)) return;
  what_ = *prepared.what;
  prepared_.what = &what_;
  for (const CheckSpec& check : what_.checks) {
    if (has_reference(check) && !check.reference_run) run(prepared, check.reference, what_.checks);
  }
}

void check_references(const PreparedCase& prepared, ProblemList& problems) {
  const Case& c = *prepared.what;
  for (const CheckSpec& check : c.checks) {
    if (!has_reference(check)) continue;
    const auto report = [&](const std::string& rule) {
      problems.add(c.file, check.line, "check.reference", rule);
    };
    try {
      if (const std::string why = misfit(driven_by(c, check.reference), prepared.bench_file); !why.empty())
        report(fmt::format("is \"{}\", which does not fit the bench: {}", check.reference, why));
    } catch (const UsageError& error) {
      report(error.what());
    }
  }
}

}  // namespace drivebench::command
