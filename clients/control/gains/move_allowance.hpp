#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "clients/control/gains/gains.hpp"

namespace drivebench::control {

/// What the references of a move may ask for; a move that asks for more is refused before it starts. Usually
/// the limits of the amplifier; more where a run has to show what happens beyond them.
struct MoveAllowance {
  double voltage_v;
  double current_a;

  static std::span<const GainRow<MoveAllowance>> gains() noexcept {
    static constexpr auto kRows = std::to_array<GainRow<MoveAllowance>>({
        {"allowed.voltage_v", [](MoveAllowance& p) -> double& { return p.voltage_v; }, GainRule::kPositive},
        {"allowed.current_a", [](MoveAllowance& p) -> double& { return p.current_a; }, GainRule::kPositive},
    });
    return kRows;
  }
  std::vector<std::string> problems() const { return range_problems(*this); }
};

}  // namespace drivebench::control
