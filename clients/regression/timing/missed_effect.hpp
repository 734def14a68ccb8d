#pragma once

#include <string>
#include <vector>

#include "clients/regression/checks/trace.hpp"

namespace drivebench::regression {

/// A signal of a run in real time beside that of the same run in lockstep, where every answer comes in time.
struct SignalEffect {
  std::string axis;
  std::string signal;
  std::string unit;
  double rms = 0.0;      ///< of the difference
  double worst = 0.0;    ///< difference
  double worst_s = 0.0;  ///< where it is
  struct Point {
    double time_s;
    double in_real_time;
    double in_time;
  };
  std::vector<Point> points{};  ///< for a drawing: of each part of the run where both differ most
};

/// What late and missed answers changed. Both runs are the same up to the tick in which the device under test
/// took its lease.
struct MissedEffect {
  double from_s = 0.0;
  std::string problem{};  ///< the reason why it is not known
  std::vector<SignalEffect> signals{};
};

/// The difference of two runs from a time on, up to the end of the shorter one.
MissedEffect missed_effect(const Trace& in_real_time, const Trace& in_time, double from_s);

/// Both curves over time; empty if there are fewer than two points.
std::string svg_effect(const SignalEffect& effect);

}  // namespace drivebench::regression
