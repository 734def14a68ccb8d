#pragma once

namespace drivebench::speed {

/// What the command line asks for.
struct Plan {
  double soak_minutes = 0.2;  ///< of the memory measurement
  bool brief = false;         ///< each measurement runs; its figures say nothing
};

/// The plan of this process; changed before the first measurement alone.
inline Plan& plan() noexcept {
  static Plan only;
  return only;
}

/// How often, how long or how many: `least` in a brief run.
template <class Amount>
Amount planned(Amount full, Amount least) noexcept {
  return plan().brief ? least : full;
}

}  // namespace drivebench::speed
