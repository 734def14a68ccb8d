#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "clients/web/gateway/drive/open_loop.hpp"

namespace drivebench::web {

/// A text that is no order: what() names field, value and rule.
struct OrderError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What the page asks of the gateway, of its drive and of its runs. As JSON:
///
///   {"op": "drive", "axes": [{"axis": 0, "gates": "voltage", "constant": [a, b, c, f], "boost": U,
///                             "per_hz": U, "frequency_hz": f, "ramp_s": t}]}
///   {"op": "drive", "axes": [{"axis": 0, "preset": "book/8.2.2", "run": n}]}
///   {"op": "pace", "pace": x}
///   {"op": "step", "ticks": n}
///   {"op": "presets"}
///   {"op": "alive"}
///   {"op": "run_suite", "suite": "servo"}
///   {"op": "identify", "experiment": n, "owner": "SECRET", "axis": 0, "motor": "dc"}
///   {"op": "cancel_run", "run": n}
///
/// `drive` names all axes of the drive, each with its target or with the preset of a reference controller:
/// without any it switches off and gives the leases back. The same `run` of an axis goes on, another one
/// begins. `pace` is for lockstep, the seconds of the bench in a second, 0 to 1; at 0 time stands still, but
/// for the ticks of `step`, 1 to 1,000,000. `presets` asks which presets fit the axes.
struct Order {
  enum class Kind { kDrive, kPace, kStep, kPresets, kAlive, kRunSuite, kIdentify, kCancelRun };
  struct Axis {
    std::uint32_t axis = 0;
    OpenLoopTarget target{};
    std::string preset{};  ///< empty: open loop
    std::uint64_t run = 0;
  };

  struct Identification {
    std::uint64_t experiment = 0;
    std::string owner{};  ///< the secret that opens its recording
    std::uint32_t axis = 0;
    std::string motor{};
  };

  Kind kind = Kind::kAlive;
  std::vector<Axis> axes{};
  double pace = 0.0;
  std::uint64_t ticks = 0;
  std::string suite{};
  Identification identification{};
  std::uint64_t run = 0;  ///< that is cancelled

  /// For the runs of the gateway, not for the drive.
  bool is_for_runs() const noexcept { return kind >= Kind::kRunSuite; }
};

/// For a bench with so many axes. Throws OrderError.
Order parse_order(std::string_view text, std::size_t axis_count);

/// The word of an order for gates; empty: no order has them.
std::string_view word_of(v1::Gates gates) noexcept;

}  // namespace drivebench::web
