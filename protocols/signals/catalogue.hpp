#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string_view>

#include "protocols/signals/sample.hpp"

namespace drivebench {

/// The type of a signal, which is also its encoding.
enum class SignalType {
  kUnsigned,  ///< uint64 on the wire
  kSigned,    ///< sint64 (zigzag) on the wire
  kReal,      ///< double on the wire
};

/// The origin of a signal. A controller on a real bench gets status and sensors, never the truth.
enum class SignalKind { kStatus, kSensor, kTruth };

/// One row of the catalogue.
struct Signal {
  std::string_view name;
  std::string_view unit;
  SignalType type;
  SignalKind kind;
  double minimum;  ///< of the usual range, for displays and scaled encodings
  double maximum;
  std::uint64_t Sample::*as_unsigned;
  std::int64_t Sample::*as_signed;
  double Sample::*as_real;
  std::string_view meaning;
};

namespace catalogue_detail {

constexpr double kAnyTick = 9.007199254740992e15;  // 2^53: a double holds every integer up to here

constexpr Signal signal(std::string_view name, std::string_view unit, SignalKind kind, double minimum,
                        double maximum, std::uint64_t Sample::*member, std::string_view meaning) {
  return {name, unit, SignalType::kUnsigned, kind, minimum, maximum, member, nullptr, nullptr, meaning};
}
constexpr Signal signal(std::string_view name, std::string_view unit, SignalKind kind, double minimum,
                        double maximum, std::int64_t Sample::*member, std::string_view meaning) {
  return {name, unit, SignalType::kSigned, kind, minimum, maximum, nullptr, member, nullptr, meaning};
}
constexpr Signal signal(std::string_view name, std::string_view unit, SignalKind kind, double minimum,
                        double maximum, double Sample::*member, std::string_view meaning) {
  return {name, unit, SignalType::kReal, kind, minimum, maximum, nullptr, nullptr, member, meaning};
}

}  // namespace catalogue_detail

/// The rows of signals.inc: the position of a row is the field number in message Sample, from 1.
inline constexpr auto kSignals = [] {
  using namespace catalogue_detail;
  using enum SignalKind;
  return std::to_array<Signal>({
#define DRIVEBENCH_UNSIGNED(kind, name, unit, maximum, meaning) \
  signal(#name, unit, kind, 0.0, maximum, &Sample::name, meaning),
#define DRIVEBENCH_SIGNED(kind, name, unit, first, minimum, maximum, meaning) \
  signal(#name, unit, kind, minimum, maximum, &Sample::name, meaning),
#define DRIVEBENCH_REAL(kind, name, unit, minimum, maximum, meaning) \
  signal(#name, unit, kind, minimum, maximum, &Sample::name, meaning),
#include "protocols/signals/signals.inc"
  });
}();

/// The value as a double, for displays and exports of small integers.
constexpr double value_of(const Signal& signal, const Sample& sample) noexcept {
  switch (signal.type) {
    case SignalType::kUnsigned:
      return static_cast<double>(sample.*signal.as_unsigned);
    case SignalType::kSigned:
      return static_cast<double>(sample.*signal.as_signed);
    case SignalType::kReal:
      break;
  }
  return sample.*signal.as_real;
}

/// The row with this name, or null.
constexpr const Signal* find_signal(std::string_view name) noexcept {
  for (const Signal& signal : kSignals) {
    if (signal.name == name) return &signal;
  }
  return nullptr;
}

/// A set of signals: bit n is row n.
__extension__ using SignalMask = unsigned __int128;
static_assert(kSignals.size() < 128);
inline constexpr SignalMask kAllSignals = (SignalMask{1} << kSignals.size()) - 1;

}  // namespace drivebench
