#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "plant/drive/inverter.hpp"
#include "protocols/signals/command.hpp"

namespace drivebench {

/// The supplies of the gate drivers of the upper switches. 8-byte members only; all zero they are full.
struct BootstrapMemory {
  std::array<double, 3> used_s{};   ///< of the time that a full supply lasts, at since_s
  std::array<double, 3> since_s{};  ///< from the start of the tick that is running
  std::array<std::int64_t, 3>
      level{};              ///< since then: 1 the upper switch is closed, -1 the lower one, 0 none
  std::uint64_t empty = 0;  ///< legs whose upper switch cannot close, bit 0 for a
};

/// Capacitors that feed the upper gate drivers. A closed upper switch takes its time from the supply of its
/// leg, full it lasts bootstrap_s; a closed lower one gives it back within bootstrap_recharge_s. An empty
/// supply opens its switch, which stays open until the supply is full.
///
/// Between two changes of a leg its supply goes along a straight line from the one of the last change: no
/// result depends on how the time between them is divided.
class Bootstrap {
 public:
  Bootstrap(const InverterParameters& p, double period_s) noexcept
      : limit_s_(p.bootstrap_s),
        recharge_s_(p.bootstrap_recharge_s),
        period_s_(period_s),
        tolerance_s_(1e-9 * period_s) {}
  bool used() const noexcept { return limit_s_ > 0.0; }

  /// A tick has ended, the next one begins.
  void begin_tick(BootstrapMemory& m) const noexcept;
  /// The switches that are closed from now on. Whether other legs are empty than before, so that others may
  /// be closed: ask again.
  bool meet(BootstrapMemory& m, double now_s, const LegLevels& closed) const noexcept;
  /// When the next supply is empty if no leg changes before, or end_s.
  double stop_s(const BootstrapMemory& m, double end_s) const noexcept;

 private:
  double used_at_s(const BootstrapMemory& m, std::size_t leg, double now_s) const noexcept;
  double empty_s(const BootstrapMemory& m, std::size_t leg) const noexcept {
    return m.since_s[leg] + (limit_s_ - m.used_s[leg]);
  }

  double limit_s_;
  double recharge_s_;
  double period_s_;
  double tolerance_s_;  ///< instants closer than this are one
};

}  // namespace drivebench
