#pragma once

#include "protocols/can/table.hpp"
#include "server/bench/input.hpp"

namespace drivebench::can {

/// How the profile says why the bench turned something away.
constexpr Result result_of(Refused why) noexcept {
  switch (why) {
    case Refused::kNot:
      return Result::kDone;
    case Refused::kOwned:
      return Result::kOwned;
    case Refused::kNotFinite:
      return Result::kNotFinite;
    case Refused::kLatched:
      return Result::kLatched;
    case Refused::kStale:
      return Result::kStale;
    case Refused::kBusy:
    case Refused::kTooManyRamps:
      return Result::kBusy;
    case Refused::kWrongDrive:
      return Result::kWrongDrive;
    case Refused::kBeyondDrive:
      return Result::kBeyondDrive;
    case Refused::kCauseLasts:
      return Result::kCauseLasts;
    case Refused::kOutOfRange:
    case Refused::kRuleBroken:
      return Result::kMalformed;
    case Refused::kUnknownAxis:
    case Refused::kNotOwner:
      break;
  }
  return Result::kNotOwner;
}

/// Of a field that holds an unsigned number.
constexpr std::uint64_t unsigned_of(double value) noexcept {
  return value > 0.0 ? static_cast<std::uint64_t>(value) : 0;
}

}  // namespace drivebench::can
