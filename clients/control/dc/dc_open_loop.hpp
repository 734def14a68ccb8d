#pragma once

#include "clients/control/dc/dc_controller.hpp"

namespace drivebench::control {

struct DcOpenLoopParameters {
  DcAxisParameters axis;

  static std::span<const GainRow<DcOpenLoopParameters>> gains() noexcept;
  std::vector<std::string> problems() const { return dc_problems(*this); }
};

/// The current of the reference alone, i_ref = (J·α_ref + f·ω_ref)/K_T, with nothing fed back but the
/// current: it shows the current loop, and what every offset, friction and load does without a position loop.
/// Source: Chiasson 2005, 2.2 (CUR-01), problem 2.19 (a-d).
class DcOpenLoop final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcOpenLoop(const DcOpenLoopParameters& p) noexcept
      : DcController(p.axis, Law::kCurrent), machine_(p.axis.machine) {}

 private:
  double wanted(const Reference& r, const ShaftEstimate&, double) noexcept override {
    return machine_.current_a(r);
  }
  void integrate(double) noexcept override {}

  DcMachineModel machine_;
};

}  // namespace drivebench::control
