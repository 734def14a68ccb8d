#pragma once

#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// The trajectory of parameters that have at(t) and duration_s, a member or a function. They must have no
/// problems().
template <class Parameters>
class MoveOf final : public Trajectory {
 public:
  explicit MoveOf(const Parameters& p) noexcept : p_(p) {}
  Reference at(double t_s) const noexcept override { return p_.at(t_s); }
  double duration_s() const noexcept override {
    if constexpr (requires { p_.duration_s(); }) {
      return p_.duration_s();
    } else {
      return p_.duration_s;
    }
  }

 private:
  Parameters p_;
};

}  // namespace drivebench::control
