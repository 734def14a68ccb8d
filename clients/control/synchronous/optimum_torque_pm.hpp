#pragma once

#include <optional>
#include <vector>

#include "clients/models/pm_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// Limits of a synchronous machine in two-phase magnitudes: |u| and |i|, not those of a phase.
struct PmLimits {
  double voltage_v;
  double current_a;
};

/// The limit that bounds the torque.
enum class LimitInForce { kCurrent, kBoth, kVoltage };

struct PmOptimum {
  double torque_nm;
  Dq current_a;
  LimitInForce limit;
};

/// The largest (direction > 0) or most negative torque that a machine turning steadily at this speed can give
/// within both limits; nothing where no current within them keeps the voltage. With X = n_p·ω·L_S and
/// Z² = R_S² + X²:
///   current alone   i_d = 0, i_q = ±I
///   voltage alone   i_d = −X·K_m·ω/Z², i_q = (±V·Z − K_m·ω·R_S)/Z²
///   both            where the circles |i| = I and |u| = V meet
/// Source: the book, 9.2 (PMT-01..04).
std::optional<PmOptimum> optimum_torque(const PmMachineModel& p, const PmLimits& limits, double speed_rad_s,
                                        double direction) noexcept;

/// |u| of a machine turning steadily with these currents.
double steady_voltage_v(const PmMachineModel& p, double speed_rad_s, Dq i) noexcept;

/// The direct current closest to zero that keeps the voltage within its limit while i_q flows; the one of
/// least voltage where none does.
double direct_current_within_voltage_a(const PmMachineModel& p, double voltage_limit_v, double speed_rad_s,
                                       double i_q_a) noexcept;

/// The optimum over the speed, for use on line: linear between points, symmetric in the speed.
class PmTorqueTable {
 public:
  /// `points` at least 2. Throws std::invalid_argument if the machine cannot be kept within the limits at
  /// some speed up to the largest one.
  PmTorqueTable(const PmMachineModel& p, const PmLimits& limits, double max_speed_rad_s, int points);

  /// Beyond the largest speed: what holds there.
  Dq current_a(double speed_rad_s, double direction) const noexcept;

 private:
  struct Row {
    Dq motoring_a;
    Dq braking_a;
  };
  double rows_per_rad_s_;
  std::vector<Row> rows_;
};

}  // namespace drivebench::control
