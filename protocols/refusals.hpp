#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

/// The reasons of refusals and their codes in each protocol: one table. Includes nothing but std.
namespace drivebench {

/// The reason why the bench refused a request, in the order of the rows of kRefusals.
enum class Refused : std::uint32_t {
  kNot,
  kNotOwner,
  kOwned,
  kNotFinite,
  kLatched,
  kStale,
  kBusy,
  kMalformed,
  kIncomplete,
  kWrongDrive,
  kOutOfRange,
  kBeyondDrive,
  kCauseLasts,
  kUnknownAxis,
  kWrongMode,
  kRuleBroken,
  kTooManyRamps,
  kSharedAmplifier,
};

/// The codes of bench.proto's RefusalCode that the table needs. A test compares them with the schema.
enum class TcpRefusal : int {
  kUnspecified = 0,
  kMalformed = 1,
  kUnknownAxis = 4,
  kUnknownParameter = 6,
  kOutOfRange = 7,
  kNotFinite = 8,
  kNotOwner = 9,
  kOwned = 10,
  kLatched = 11,
  kStale = 12,
  kBusy = 13,
  kReadOnly = 14,
  kWrongMode = 15,
  kWrongDrive = 16,
  kUnknownFault = 17,
  kCauseLasts = 21,
  kSharedAmplifier = 23,
};

namespace can {

/// The codes of the field `result` of a reply.
enum class Result : std::uint8_t {
  kDone = 0,
  kNotOwner = 1,
  kOwned = 2,
  kNotFinite = 3,
  kLatched = 4,
  kStale = 5,
  kBusy = 6,
  kMalformed = 7,
  kIncomplete = 8,
  kWrongDrive = 9,
  kBeyondDrive = 10,
  kCauseLasts = 11,
  kSharedAmplifier = 12,
};

}  // namespace can

namespace modbus {

/// The values of the register last_refusal.
enum class Refusal : std::uint16_t {
  kNone = 0,
  kUnknownAxis = 1,
  kNotOwner = 2,
  kOwned = 3,
  kNotFinite = 4,
  kLatched = 5,
  kStale = 6,
  kBusy = 7,
  kOutOfRange = 8,
  kWrongMode = 9,
  kWrongDrive = 10,
  kCauseLasts = 11,
  kSharedAmplifier = 12,
};

/// The exception codes of Modbus that the bench answers with.
enum class Exception : std::uint8_t {
  kNone = 0,
  kIllegalFunction = 1,
  kIllegalAddress = 2,
  kIllegalValue = 3,
  kFailure = 4,
  kBusy = 6,
  kNoTarget = 11,
};

}  // namespace modbus

/// One verdict: its name in lists of codes, its sentence for people, its code in each protocol. Where a
/// protocol has one code for several verdicts, the first of their rows says what the code means.
struct RefusalRow {
  Refused refused;
  std::string_view words;
  TcpRefusal tcp;
  can::Result can;
  modbus::Refusal modbus;
  modbus::Exception exception;
  std::string_view sentence;
};

namespace refusals_detail {

using R = Refused;
using T = TcpRefusal;
using C = can::Result;
using M = modbus::Refusal;
using E = modbus::Exception;

}  // namespace refusals_detail

// clang-format off
inline constexpr auto kRefusals = [] {
  using namespace refusals_detail;
  return std::to_array<RefusalRow>({
      // verdict          name in lists        TCP              CAN              Modbus: register, exception
      {R::kNot,           "done",              T::kUnspecified, C::kDone,        M::kNone,        E::kNone, ""},
      {R::kNotOwner,      "not the owner",     T::kNotOwner,    C::kNotOwner,    M::kNotOwner,    E::kBusy,
       "this session does not hold the lease of the axis"},
      {R::kOwned,         "owned by another",  T::kOwned,       C::kOwned,       M::kOwned,       E::kBusy,
       "another session holds the lease of the axis"},
      {R::kNotFinite,     "not finite",        T::kNotFinite,   C::kNotFinite,   M::kNotFinite,   E::kIllegalValue,
       "a value is not a finite number"},
      {R::kLatched,       "latched",           T::kLatched,     C::kLatched,     M::kLatched,     E::kFailure,
       "a latched fault is in force; its owner must clear it first"},
      {R::kStale,         "stale",             T::kStale,       C::kStale,       M::kStale,       E::kFailure,
       "the command answers a sample that is too old, already answered or not taken yet"},
      {R::kBusy,          "busy",              T::kBusy,        C::kBusy,        M::kBusy,        E::kBusy,
       "too many requests are waiting for the bench"},
      // Only CAN uses the next two: elsewhere a codec refuses such a request.
      {R::kMalformed,     "malformed",         T::kMalformed,   C::kMalformed,   M::kNone,        E::kIllegalValue,
       "a field of the frame has a value that means nothing"},
      {R::kIncomplete,    "incomplete",        T::kMalformed,   C::kIncomplete,  M::kNone,        E::kIllegalValue,
       "phase c and the field of its tick are missing"},
      {R::kWrongDrive,    "wrong drive",       T::kWrongDrive,  C::kWrongDrive,  M::kWrongDrive,  E::kFailure,
       "GATES_CURRENT needs a drive of kind \"current_amplifier\", GATES_EDGES one of kind \"switched_inverter\"; the drive of "
       "the axis is another"},
      {R::kOutOfRange,    "out of range",      T::kOutOfRange,  C::kMalformed,   M::kOutOfRange,  E::kIllegalValue,
       "a value is outside of its limits"},
      {R::kBeyondDrive,   "beyond drive",      T::kOutOfRange,  C::kBeyondDrive, M::kOutOfRange,  E::kIllegalValue,
       "a set-point is beyond what the drive of the axis can give, or moves faster than it may"},
      {R::kCauseLasts,    "cause lasts",       T::kCauseLasts,  C::kCauseLasts,  M::kCauseLasts,  E::kFailure,
       "what caused the latched fault is still there: over-current, the fault line of a gate driver, a lossy "
       "command link, or a controller whose last command was refused for its values"},
      {R::kUnknownAxis,   "no such axis",      T::kUnknownAxis, C::kNotOwner,    M::kUnknownAxis, E::kNoTarget,
       "there is no such axis"},
      {R::kWrongMode,     "wrong mode",        T::kWrongMode,   C::kBusy,        M::kWrongMode,   E::kFailure,
       "a free run takes no controller"},
      {R::kRuleBroken,    "rule broken",       T::kOutOfRange,  C::kMalformed,   M::kOutOfRange,  E::kIllegalValue,
       "the parameter would break a rule with the values that hold now"},
      {R::kTooManyRamps,  "too many ramps",    T::kBusy,        C::kBusy,        M::kBusy,        E::kBusy,
       "16 parameters of the axis are on their way already"},
      {R::kSharedAmplifier, "shares amplifier", T::kSharedAmplifier, C::kSharedAmplifier, M::kSharedAmplifier,
       E::kFailure, "the axis takes the voltages of another axis, whose amplifier it shares"},
  });
}();
// clang-format on

constexpr const RefusalRow& refusal_row(Refused why) noexcept {
  return kRefusals[static_cast<std::size_t>(why)];
}
static_assert([] {
  for (std::size_t i = 0; i < kRefusals.size(); ++i) {
    if (kRefusals[i].refused != static_cast<Refused>(i)) return false;
  }
  return refusal_row(Refused::kSharedAmplifier).refused == Refused::kSharedAmplifier;
}());

/// Whether the sender did not hold the lease, or the axis has none: such a request is no part of the run.
constexpr bool lacks_lease(Refused why) noexcept {
  return why == Refused::kNotOwner || why == Refused::kOwned || why == Refused::kSharedAmplifier;
}

/// The reason for people; empty for kNot.
constexpr std::string_view sentence_of(Refused why) noexcept {
  return refusal_row(why).sentence;
}

/// The meaning of a code of a protocol: `column` is its member of a row. A code that no row has means
/// `otherwise`.
template <class Code>
constexpr const RefusalRow& refusal_meant_by(Code RefusalRow::*column, Code code,
                                             Refused otherwise) noexcept {
  for (const RefusalRow& row : kRefusals) {
    if (row.*column == code) return row;
  }
  return refusal_row(otherwise);
}

namespace refusals_detail {

/// A list of codes as text, made when the program is compiled.
struct CodeList {
  std::array<char, 256> text{};
  std::size_t size = 0;

  constexpr void add(std::string_view more) noexcept {
    for (const char c : more)
      text[size++] = c;
  }
};

/// "`zero`, 1 not the owner, 2 owned by another ...": every code of the column, in ascending order.
template <class Code>
constexpr CodeList list_codes(Code RefusalRow::*column, std::string_view zero) noexcept {
  CodeList list;
  list.add(zero);
  for (unsigned code = 1; code < 100; ++code) {
    for (const RefusalRow& row : kRefusals) {
      if (static_cast<unsigned>(row.*column) != code) continue;
      const char digits[] = {static_cast<char>('0' + code / 10), static_cast<char>('0' + code % 10)};
      list.add(", ");
      list.add(code < 10 ? std::string_view(digits + 1, 1) : std::string_view(digits, 2));
      list.add(" ");
      list.add(row.words);
      break;
    }
  }
  return list;
}

inline constexpr CodeList kCan = list_codes(&RefusalRow::can, "0 done");
inline constexpr CodeList kModbus =
    list_codes(&RefusalRow::modbus, "why the last write here was refused: 0 none yet");

}  // namespace refusals_detail

/// The meaning of the field `result` in the DBC file, and of last_refusal in the register map.
inline constexpr std::string_view kCanResultMeaning(refusals_detail::kCan.text.data(),
                                                    refusals_detail::kCan.size);
inline constexpr std::string_view kLastRefusalMeaning(refusals_detail::kModbus.text.data(),
                                                      refusals_detail::kModbus.size);

}  // namespace drivebench
