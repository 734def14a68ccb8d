#include "clients/regression/checks/check_kinds.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <vector>

#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {

std::span<const CheckKind> check_kinds() noexcept {
  static const std::vector<CheckKind> kAll = [] {
    std::vector<CheckKind> all;
    for (const auto family : {value_checks(), step_checks(), spectrum_checks(), response_checks(),
                              condition_checks(), tube_checks()})
      all.insert(all.end(), family.begin(), family.end());
    return all;
  }();
  return kAll;
}

bool fails_at_once(std::string_view kind) noexcept {
  static constexpr auto kAtOnce =
      std::to_array<std::string_view>({"bounds", "tube", "always", "never", "overshoot", "ripple"});
  return std::ranges::find(kAtOnce, kind) != kAtOnce.end();
}

std::string problem_on_bench(const CheckSpec& spec, const RunFacts& facts) {
  if (spec.kind->watches == Watches::kFault &&
      std::ranges::find(facts.faults, spec.fault, &RunFacts::Fault::name) == facts.faults.end()) {
    return fmt::format("fault is \"{}\", but the bench has no such fault{}", printable(spec.fault),
                       advice(spec.fault, facts.faults, &RunFacts::Fault::name));
  }
  const double end_s = static_cast<double>(facts.end_tick) * facts.period_s;
  if (spec.from_s > end_s) {
    return fmt::format("from_s is {:.6g} but the case ends at {:.6g} s", spec.from_s, end_s);
  }
  if (spec.to_s && *spec.to_s > end_s * (1.0 + 1e-12)) {
    return fmt::format("to_s is {:.6g} but the case ends at {:.6g} s", *spec.to_s, end_s);
  }
  return spec.kind->problem_on_bench != nullptr ? spec.kind->problem_on_bench(spec, facts) : std::string();
}

}  // namespace drivebench::regression
