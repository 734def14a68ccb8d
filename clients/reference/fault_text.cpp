#include "clients/reference/fault_text.hpp"

#include <fmt/core.h>

#include <array>

#include "protocols/text.hpp"

namespace drivebench::reference {
namespace {

template <class Descriptions>
std::string names_of(const Descriptions& descriptions, std::uint64_t bits) {
  std::string names;
  for (const auto& each : descriptions) {
    if ((bits & each.bit()) == 0) continue;
    bits &= ~each.bit();
    names += (names.empty() ? "" : " ") + printable(each.name());
  }
  if (bits != 0) names += fmt::format("{}{:#x}", names.empty() ? "" : " ", bits);
  return names.empty() ? "none" : names;
}

}  // namespace

const char* name_of_state(std::uint64_t state) noexcept {
  constexpr std::array kNames = {"idle", "run", "hold", "timeout", "fault", "ready"};
  return state < kNames.size() ? kNames[state] : "unknown";
}

std::string fault_names(const v1::BenchDescription& bench, std::uint64_t faults) {
  return names_of(bench.faults(), faults);
}

std::string injected_names(const v1::BenchDescription& bench, std::uint64_t injected) {
  return names_of(bench.injectable_faults(), injected);
}

std::uint64_t latched_faults(const v1::BenchDescription& bench, std::uint64_t faults) {
  std::uint64_t latched = 0;
  for (const v1::FaultDescription& fault : bench.faults()) {
    if (fault.latched()) latched |= fault.bit();
  }
  return faults & latched;
}

std::string latched_text(const v1::BenchDescription& bench, const Sample& sample) {
  if (bench.faults_size() != 0) {
    const std::uint64_t latched = latched_faults(bench, sample.faults);
    return latched == 0 ? "" : fault_names(bench, latched);
  }
  constexpr std::uint64_t kTimeout = 3;
  constexpr std::uint64_t kFault = 4;
  if (sample.state != kTimeout && sample.state != kFault) return {};
  return fmt::format("{}, fault word {:#x}", name_of_state(sample.state), sample.faults);
}

}  // namespace drivebench::reference
