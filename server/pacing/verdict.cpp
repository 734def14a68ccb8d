#include "server/pacing/verdict.hpp"

#include <fmt/core.h>

namespace drivebench {
namespace {

std::string timing(const Verdict& v) {
  const auto us = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-3; };
  const std::string lateness = fmt::format(
      "lateness p50 below {:.1f} us, p99 below {:.1f} us, worst {:.1f} us", us(v.lateness.percentile_ns(0.5)),
      us(v.lateness.percentile_ns(0.99)), us(v.lateness.worst_ns()));
  switch (v.mode) {
    case RunMode::kRealtime:
      if (v.late_ticks == 0)
        return fmt::format("real-time valid: {} ticks, none late, {}", v.ticks, lateness);
      return fmt::format("not real-time valid: {} of {} ticks late, {}", v.late_ticks, v.ticks, lateness);
    case RunMode::kLockstep:
      return fmt::format("lockstep exact: {} ticks", v.ticks);
    case RunMode::kFree:
      break;
  }
  return fmt::format("free run exact: {} ticks", v.ticks);
}

}  // namespace

std::string Verdict::sentence() const {
  std::string sentence = timing(*this);
  if (gaps > 0) sentence += fmt::format("; the recording lost {} entries and does not replay", gaps);
  if (!remarks.empty()) sentence += "; " + remarks;
  return sentence;
}

}  // namespace drivebench
