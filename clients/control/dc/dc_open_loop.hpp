#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/dc/dc_controller.hpp"
#include "clients/control/dc/dc_references.hpp"

namespace drivebench::control {

struct DcOpenLoopParameters {
  DcAxisParameters axis;

  static constexpr std::tuple kGains{gains_in("", &DcOpenLoopParameters::axis)};
  std::vector<std::string> problems() const { return dc_problems(*this); }
};

/// The current of the reference alone, i_ref = (J·α_ref + f·ω_ref)/K_T, with nothing fed back but the
/// current: it shows the current loop, and what every offset, friction and load does without a position loop.
/// Source: the book, 2.2 (CUR-01), problem 2.19 (a-d).
class DcOpenLoop final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcOpenLoop(const DcOpenLoopParameters& p) noexcept
      : DcController(p.axis, Law::kCurrent), machine_(p.axis.machine) {}

 private:
  double wanted(const Reference& r, const ShaftEstimate&, double) noexcept override {
    return reference_current_a(machine_, r);
  }
  void integrate(double) noexcept override {}

  DcMachineModel machine_;
};

}  // namespace drivebench::control
