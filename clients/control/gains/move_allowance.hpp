#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/gains/gains.hpp"

namespace drivebench::control {

/// The most that the references of a move may demand; a move that demands more is refused before it starts.
/// Usually the limits of the amplifier; more where a run has to show what happens beyond them.
struct MoveAllowance {
  double voltage_v;
  double current_a;

  static constexpr std::tuple kGains{
      gain("allowed.voltage_v", &MoveAllowance::voltage_v, GainRule::kPositive),
      gain("allowed.current_a", &MoveAllowance::current_a, GainRule::kPositive)};
  std::vector<std::string> problems() const { return range_problems(*this); }
};

}  // namespace drivebench::control
