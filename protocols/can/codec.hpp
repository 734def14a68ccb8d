#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string_view>

#include "protocols/can/frame.hpp"
#include "protocols/can/profile.hpp"
#include "protocols/can/table.hpp"
#include "protocols/signals/sample.hpp"

/// Encodes values into frames and decodes them, by loops over the table. Every `row` is an element of
/// kMessages.
///
/// Values outside the range of a field: counters and signed numbers wrap; codes and scaled numbers saturate;
/// a number beyond the largest single becomes an infinity. NaN becomes "no value" where the encoding has one
/// (field.hpp), and 0 in counters, signed numbers and codes. Infinity becomes 0 in counters and signed
/// numbers. Fractions of a count are rounded to the nearest, halves away from zero.
namespace drivebench::can {

/// One number for each field of a message, in the order of the fields; NaN: no value.
using Values = std::array<double, kMaxFields>;

/// The index of a field in its message and in Values. In a constant expression an unknown name does not
/// compile.
constexpr std::size_t index_of(const MessageRow& row, std::string_view field) {
  for (std::size_t i = 0; i < row.fields.size(); ++i) {
    if (row.fields[i].name == field) return i;
  }
  std::abort();
}
/// Example: index_of(Message::kCommand, false, "lease").
constexpr std::size_t index_of(Message message, bool fd, std::string_view field, bool wide = false) {
  const MessageRow* const row = find_message(message, fd, wide);
  if (row == nullptr) std::abort();
  return index_of(*row, field);
}

inline constexpr unsigned kVoltageMode = 1;
/// The modes in which a command gives duties; one count of a classic frame is then kDutyUnit. The first
/// counts the legs of a star from the middle of the link, -1 to 1; the second as every other link, 0 to 1
/// from the negative rail.
inline constexpr unsigned kDutyMode = 3;
inline constexpr unsigned kLegDutyMode = 5;
/// The mode in which a command gives currents; one count is then current_unit_a of the profile.
inline constexpr unsigned kCurrentMode = 4;

/// Encodes one value for each field; bytes outside the fields are 0. In the FD profile every frame is an FD
/// frame with bit rate switch. The first value of a paged message selects the page.
Frame encode(const MessageRow& row, const Profile& profile, std::uint32_t node,
             std::span<const double> values) noexcept;

/// Decodes a frame for which match() found this row; fields of other pages are 0.
Values decode(const MessageRow& row, const Profile& profile, const Frame& frame) noexcept;

/// The values of the fields that carry signals; other fields are 0. Exact for integers below 2^53.
Values values_of(const MessageRow& row, const Sample& sample) noexcept;

/// Encodes the signals of a sample; exact for all integers.
Frame encode_sample(const MessageRow& row, const Profile& profile, std::uint32_t node, const Sample& sample,
                    Page page = Page{}) noexcept;

/// Puts the values of a frame into the signals that they carry. A number that wraps becomes the number with
/// these low bits that is nearest to the one in the sample.
void update_sample(const MessageRow& row, std::span<const double> values, Sample& sample) noexcept;

/// The number nearest to `near` with these low bits; of two at equal distance the lower. `bits` is 1..64.
constexpr std::int64_t unwrap(std::uint64_t low_bits, unsigned bits, std::int64_t near) noexcept {
  const unsigned unused = 64 - bits;
  const std::uint64_t start = static_cast<std::uint64_t>(near);
  const std::int64_t distance = static_cast<std::int64_t>((low_bits - start) << unused) >> unused;
  return static_cast<std::int64_t>(start + static_cast<std::uint64_t>(distance));
}

/// The problem of a frame; the first in this order that applies.
enum class FrameProblem : std::uint8_t {
  kNone,
  kError,        ///< an error frame: no message at all
  kForeign,      ///< the identifier is none of this profile
  kWrongFormat,  ///< an identifier of this profile, but with 29 bits instead of 11, or the reverse
  kRemote,       ///< a remote frame
  kWrongKind,    ///< an FD frame in the classic profile, or a classic frame with a message of FD only
  kWrongSize,
  kReserved,  ///< a byte outside the fields of its page is not 0
};
inline constexpr std::size_t kFrameProblems = static_cast<std::size_t>(FrameProblem::kReserved) + 1;

std::string_view name_of(FrameProblem problem) noexcept;

/// The message that a frame carries, and its node.
struct Match {
  const MessageRow* row = nullptr;  ///< null if foreign or an error
  std::uint32_t node = 0;           ///< 0 if the message has none
  FrameProblem problem = FrameProblem::kForeign;

  bool ok() const noexcept { return problem == FrameProblem::kNone; }
};

/// Finds the message that a frame carries and checks its form. In the FD profile, messages of both variants
/// may also come in classic frames. On a bus with wide axes the size distinguishes the sensors and commands
/// of wide axes from those of narrow ones.
Match match(const Profile& profile, const Frame& frame) noexcept;

/// An edge of the encoder in the message `edges`.
struct Edge {
  std::uint16_t time = 0;  ///< since the start of the tick, in units of period/32768: 0..32767
  bool down = false;       ///< the count went down

  bool operator==(const Edge&) const = default;
};
/// Writes edge `index` < kEdgesPerFrame of such a frame.
void put_edge(Frame& frame, std::size_t index, Edge edge) noexcept;

}  // namespace drivebench::can
