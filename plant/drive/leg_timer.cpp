#include "plant/drive/leg_timer.hpp"

#include <algorithm>

namespace drivebench {
namespace {

constexpr std::size_t switch_of(LegLevel level) noexcept {
  return level == LegLevel::kHigh ? 1 : 0;
}

}  // namespace

bool is_possible(const LegSetting& s) noexcept {
  const auto within = [](Picoseconds x, Picoseconds least, Picoseconds most) noexcept {
    return x >= least && x <= most;
  };
  if (s.mode > LegMode::kPwmLow || s.centred > 1 || !within(s.dead, 0, LegSetting::kLongestDead))
    return false;
  if (s.mode < LegMode::kPwm) return true;
  return within(s.period, LegSetting::kShortestPeriod, LegSetting::kLongestPeriod) &&
         within(s.compare, 0, s.period) && within(s.period_start, 0, kLastPicosecond);
}

Picoseconds LegTimer::phase(Picoseconds now) const noexcept {
  const Picoseconds rest = (now - setting_.period_start) % setting_.period;
  return rest < 0 ? rest + setting_.period : rest;
}

LegLevel LegTimer::wanted(Picoseconds now) const noexcept {
  if (setting_.mode == LegMode::kOpen) return LegLevel::kOff;
  if (setting_.mode == LegMode::kLow) return LegLevel::kLow;
  if (setting_.mode == LegMode::kHigh) return LegLevel::kHigh;
  const Picoseconds since_on = phase(now) - on_from();
  const bool on = since_on >= 0 && since_on < setting_.compare;
  if (setting_.mode == LegMode::kPwmLow) return on ? LegLevel::kLow : LegLevel::kOff;
  if (on) return LegLevel::kHigh;
  return setting_.mode == LegMode::kPwm ? LegLevel::kLow : LegLevel::kOff;
}

void LegTimer::change_to(Picoseconds now) noexcept {
  const LegLevel to = wanted(now);
  if (to != wanted_) {
    if (level_ != LegLevel::kOff) opened_[switch_of(level_)] = now;
    wanted_ = to;
    level_ = LegLevel::kOff;
    closes_ = to == LegLevel::kOff ? now : std::max(now, opened_[1 - switch_of(to)] + setting_.dead);
  }
  if (closes_ <= now) level_ = wanted_;
  next_ = next_after(now);
}

bool LegTimer::is_possible(Picoseconds now) const noexcept {
  const auto is_level = [](LegLevel level) noexcept {
    return level == LegLevel::kOff || level == LegLevel::kLow || level == LegLevel::kHigh;
  };
  const auto has_been = [now](Picoseconds at) noexcept { return at >= kLongAgo && at <= now; };
  const auto stays = [&] {
    return wanted_ == wanted(now) && level_ == (closes_ <= now ? wanted_ : LegLevel::kOff) &&
           next_ == next_after(now);
  };
  return drivebench::is_possible(setting_) && is_level(wanted_) && is_level(level_) && has_been(opened_[0]) &&
         has_been(opened_[1]) && closes_ >= kLongAgo && closes_ <= now + LegSetting::kLongestDead &&
         (next_ == now || stays());
}

Picoseconds LegTimer::next_after(Picoseconds now) const noexcept {
  Picoseconds next = closes_ > now ? closes_ : kNever;
  if (!switches()) return next;
  const Picoseconds at = phase(now);
  const Picoseconds from = on_from();
  const Picoseconds until = from + setting_.compare;
  const Picoseconds change = at < from ? from : (at < until ? until : setting_.period + from);
  return std::min(next, now + (change - at));
}

}  // namespace drivebench
