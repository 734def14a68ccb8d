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

/// Values to frames and back, by loops over the table. Every `row` is one of kMessages.
///
/// What does not fit a field: a counter and a signed number wrap; a code, a scaled number and an unsigned one
/// stop at the end of their range; a number beyond the largest single becomes an infinity. NaN is "no value"
/// where the encoding has one (table.hpp), and 0 in a counter, signed number or code, as is an infinity in
/// the first two. Fractions of a count are rounded to the nearest, halves away from zero.
namespace drivebench::can {

/// One number for each field of a message, in its order; NaN: no value.
using Values = std::array<double, kMaxFields>;

/// Where a field stands in its message and in Values. Used in a constant expression, a name that does not
/// exist does not compile.
constexpr std::size_t index_of(const MessageRow& row, std::string_view field) {
  for (std::size_t i = 0; i < row.fields.size(); ++i) {
    if (row.fields[i].name == field) return i;
  }
  std::abort();
}
/// index_of(Message::kCommand, false, "lease")
constexpr std::size_t index_of(Message message, bool fd, std::string_view field, bool wide = false) {
  const MessageRow* const row = find_message(message, fd, wide);
  if (row == nullptr) std::abort();
  return index_of(*row, field);
}

/// In this mode a command gives duties, and one count of a classic frame is worth kDutyUnit.
inline constexpr unsigned kDutyMode = 3;
inline constexpr double kDutyUnit = 1.0 / 32767.0;
/// In this mode it gives currents, and one count is worth what it is in a current.
inline constexpr unsigned kCurrentMode = 4;

/// The frame with these values, one for each field; bytes of no field are 0. In the FD profile every frame is
/// an FD frame with bit rate switch. Of a message with pages it holds the page that its first value says.
Frame encode(const MessageRow& row, const Profile& profile, std::uint32_t node,
             std::span<const double> values) noexcept;

/// The values of a frame for which match() found this row; 0 in the fields of other pages.
Values decode(const MessageRow& row, const Profile& profile, const Frame& frame) noexcept;

/// The values of the fields that carry signals of a sample; the others are 0. Exact for integers below 2^53.
Values values_of(const MessageRow& row, const Sample& sample) noexcept;

/// encode() of values_of(); exact for all integers.
Frame encode_sample(const MessageRow& row, const Profile& profile, std::uint32_t node, const Sample& sample,
                    Page page = Page{}) noexcept;

/// Puts the values of a frame into the signals that they carry. Of a number that wraps, the low bits are
/// known: the nearest to what the sample held before is taken.
void update_sample(const MessageRow& row, std::span<const double> values, Sample& sample) noexcept;

/// The number nearest to `near` with these low bits; of two as near, the lower. `bits` is 1..64.
constexpr std::int64_t unwrap(std::uint64_t low_bits, unsigned bits, std::int64_t near) noexcept {
  const unsigned unused = 64 - bits;
  const std::uint64_t start = static_cast<std::uint64_t>(near);
  const std::int64_t distance = static_cast<std::int64_t>((low_bits - start) << unused) >> unused;
  return static_cast<std::int64_t>(start + static_cast<std::uint64_t>(distance));
}

/// What is wrong with a frame; the first that applies.
enum class FrameProblem : std::uint8_t {
  kNone,
  kError,        ///< an error frame: no message at all
  kForeign,      ///< no identifier of this profile
  kWrongFormat,  ///< one of our identifiers, but with 29 bits instead of 11, or the reverse
  kRemote,       ///< asks for data
  kWrongKind,    ///< an FD frame in the classic profile, or a classic frame with a message of FD only
  kWrongSize,
  kReserved,  ///< a byte of no field, or of no field of its page, is not 0
};
inline constexpr std::size_t kFrameProblems = static_cast<std::size_t>(FrameProblem::kReserved) + 1;

std::string_view name_of(FrameProblem problem) noexcept;

/// What a frame is, and whose.
struct Match {
  const MessageRow* row = nullptr;  ///< null if foreign or an error
  std::uint32_t node = 0;           ///< 0 if the message has none
  FrameProblem problem = FrameProblem::kForeign;

  bool ok() const noexcept { return problem == FrameProblem::kNone; }
};

/// Finds the message that a frame carries and checks its form. In the FD profile the messages that exist in
/// both variants may also come in classic frames. On a bus with wide axes the size tells whose sensors and
/// commands they are.
Match match(const Profile& profile, const Frame& frame) noexcept;

/// An edge of the encoder in the message `edges`.
struct Edge {
  std::uint16_t time = 0;  ///< since the start of the tick, in units of period/32768: 0..32767
  bool down = false;       ///< the count went down

  bool operator==(const Edge&) const = default;
};
/// Reads or writes edge `index` < kEdgesPerFrame of such a frame.
Edge edge_at(const Frame& frame, std::size_t index) noexcept;
void put_edge(Frame& frame, std::size_t index, Edge edge) noexcept;

}  // namespace drivebench::can
