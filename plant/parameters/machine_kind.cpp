#include "plant/parameters/machine_kind.hpp"

#include <array>

#include "plant/train/train.hpp"

namespace drivebench {
namespace {

template <class... Machines>
std::array<MachineKind, sizeof...(Machines)> kinds_of(MachineList<Machines...>) noexcept {
  return {Machines::kind()...};
}

}  // namespace

std::span<const MachineKind> all_machine_kinds() noexcept {
  static const auto kinds = kinds_of(AllMachines{});
  return kinds;
}

const MachineKind& kind_of(const MachineParameters& machine) noexcept {
  return all_machine_kinds()[machine.index()];
}

void add_problems(const MachineParameters& machine, Problems& found) {
  if (const auto add = kind_of(machine).add_broken_rules; add != nullptr) add(machine, found);
}

}  // namespace drivebench
