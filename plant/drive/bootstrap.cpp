#include "plant/drive/bootstrap.hpp"

#include <algorithm>

namespace drivebench {
namespace {

// A supply that lacks no more than this part of its time is full: what rounding leaves.
constexpr double kFull = 1e-9;

constexpr std::int64_t level_of(LegLevel level) noexcept {
  return level == LegLevel::kHigh ? 1 : (level == LegLevel::kLow ? -1 : 0);
}

}  // namespace

double Bootstrap::used_at_s(const BootstrapMemory& m, std::size_t leg, double now_s) const noexcept {
  const double passed_s = now_s - m.since_s[leg];
  if (m.level[leg] > 0) return std::min(limit_s_, m.used_s[leg] + passed_s);
  if (m.level[leg] == 0) return m.used_s[leg];
  return passed_s < recharge_s_ ? std::max(0.0, m.used_s[leg] - passed_s * (limit_s_ / recharge_s_)) : 0.0;
}

void Bootstrap::begin_tick(BootstrapMemory& m) const noexcept {
  for (std::size_t leg = 0; leg < m.level.size(); ++leg) {
    m.used_s[leg] = used_at_s(m, leg, period_s_);
    m.since_s[leg] = 0.0;
  }
}

bool Bootstrap::meet(BootstrapMemory& m, double now_s, const LegLevels& closed) const noexcept {
  const std::uint64_t before = m.empty;
  for (std::size_t leg = 0; leg < m.level.size(); ++leg) {
    const std::uint64_t bit = std::uint64_t{1} << leg;
    if (const std::int64_t level = level_of(closed[leg]); level != m.level[leg]) {
      m.used_s[leg] = used_at_s(m, leg, now_s);
      m.since_s[leg] = now_s;
      m.level[leg] = level;
    }
    if (m.level[leg] > 0 && empty_s(m, leg) <= now_s + tolerance_s_) {
      m.used_s[leg] = limit_s_;
      m.since_s[leg] = now_s;
      m.level[leg] = 0;
      m.empty |= bit;
    } else if ((m.empty & bit) != 0 && used_at_s(m, leg, now_s) <= kFull * limit_s_) {
      m.empty &= ~bit;
    }
  }
  return m.empty != before;
}

double Bootstrap::stop_s(const BootstrapMemory& m, double end_s) const noexcept {
  double next_s = end_s;
  for (std::size_t leg = 0; leg < m.level.size(); ++leg) {
    if (m.level[leg] > 0 && empty_s(m, leg) < next_s - tolerance_s_) next_s = empty_s(m, leg);
  }
  return next_s;
}

}  // namespace drivebench
