#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "protocols/can/frame.hpp"
#include "protocols/can/table.hpp"
#include "protocols/signals/catalogue.hpp"

/// Checks the rules of the table and derives the layout of its messages, for the codec.
namespace drivebench::can {

namespace layout_detail {

/// Whether the encoding fits the signal: integers need an integer encoding, and a code has no sign.
constexpr bool can_carry(const Field& field, const Signal& signal) {
  const bool wraps = field.encoding == Encoding::kCounter || field.encoding == Encoding::kSigned;
  if (signal.type == SignalType::kReal) return !wraps && field.encoding != Encoding::kCode;
  return wraps || (field.encoding == Encoding::kCode && signal.type == SignalType::kUnsigned);
}

/// Fields are in the order of their pages; within a page they are sorted, disjoint, whole bytes or halves of
/// one, and inside the frame. Singles stand on every page: encode_sample() and decode() rely on it.
constexpr bool is_sound(const MessageRow& row) {
  if (row.fields.size() > kMaxFields || !is_fd_size(row.size)) return false;
  if ((row.variant == Variant::kFd) != (row.size > 8)) return false;  // match() relies on the size
  if (is_paged(row) && (row.fields.front().name != "page" || row.fields.front().start_bit != 0)) return false;
  unsigned common_end = 0;
  unsigned end = 0;
  std::uint8_t page = kEveryPage;
  for (const Field& field : row.fields) {
    if (field.page != page) {
      if (field.page >= kPages || field.page < (page == kEveryPage ? 0 : page)) return false;
      page = field.page;
      end = common_end;
    }
    if (field.start_bit < end || field.start_bit % (field.bits == 4 ? 4 : 8) != 0) return false;
    if (field.bits != 4 && field.bits != 8 && field.bits != 16 && field.bits != 32) return false;
    if (field.bits == 4 && field.encoding != Encoding::kCode) return false;
    if (field.encoding == Encoding::kFloat && (field.bits != 32 || field.page != kEveryPage)) return false;
    const Signal* const signal = find_signal(field.signal);
    if (field.signal.empty() != (signal == nullptr)) return false;
    if (signal != nullptr && !can_carry(field, *signal)) return false;
    end = field.start_bit + field.bits;
    if (end > 8U * row.size) return false;
    if (page == kEveryPage) common_end = end;
  }
  return true;
}

static_assert(std::ranges::all_of(kMessages, is_sound));
static_assert(kFirstEdgeByte + 2 * kEdgesPerFrame == 64);

}  // namespace layout_detail

/// A signal that frames carry as a single.
struct SingleField {
  double Sample::*signal;
  std::size_t byte;
};

/// A field that is a single.
struct FloatField {
  std::uint8_t index;
  std::uint8_t byte;
};

/// A signal that frames carry in another encoding.
struct OtherField {
  const Field* field;
  const Signal* signal;
};

/// The layout of a message, derived from its row at compile time.
struct Layout {
  std::array<const Signal*, kMaxFields> signals{};  ///< by field; null: none
  /// The same signals for encode_sample(). Singles, most of the fields of an FD frame, need no choice between
  /// encodings: apart from the others, the widest frame takes less than half the time.
  std::array<SingleField, kMaxFields> singles{};
  std::size_t single_count = 0;
  std::array<OtherField, kMaxFields> others{};
  std::size_t other_count = 0;
  /// For decode(), apart for the same reason: the fields that are singles, and the indices of the others.
  std::array<FloatField, kMaxFields> float_fields{};
  std::size_t float_count = 0;
  std::array<std::uint8_t, kMaxFields> coded_fields{};
  std::size_t coded_count = 0;
  bool paged = false;
  /// By page. Bit n: byte n belongs to no field of the page. The last element is for pages that do not exist.
  std::array<std::uint64_t, kPages + 1> reserved{};
};

namespace layout_detail {

constexpr std::uint64_t bytes_mask(unsigned first, unsigned count) {
  return count == 0 ? 0 : (~std::uint64_t{0} >> (64 - count)) << first;
}

inline constexpr auto kLayouts = [] {
  std::array<Layout, kMessages.size()> layouts{};
  for (std::size_t i = 0; i < kMessages.size(); ++i) {
    const MessageRow& row = kMessages[i];
    Layout& layout = layouts[i];
    layout.paged = is_paged(row);
    for (std::size_t f = 0; f < row.fields.size(); ++f) {
      const Field& field = row.fields[f];
      const Signal* const signal = layout.signals[f] = find_signal(field.signal);
      if (field.encoding == Encoding::kFloat) {
        layout.float_fields[layout.float_count++] = {static_cast<std::uint8_t>(f),
                                                     static_cast<std::uint8_t>(field.start_bit / 8U)};
      } else {
        layout.coded_fields[layout.coded_count++] = static_cast<std::uint8_t>(f);
      }
      if (signal == nullptr) continue;
      if (field.encoding == Encoding::kFloat) {
        layout.singles[layout.single_count++] = {signal->as_real, field.start_bit / 8U};
      } else {
        layout.others[layout.other_count++] = {&field, signal};
      }
    }
    for (std::size_t page = 0; page < layout.reserved.size(); ++page) {
      std::uint64_t& reserved = layout.reserved[page];
      reserved = bytes_mask(0, row.size);
      if (row.message == Message::kEdges) reserved &= ~bytes_mask(kFirstEdgeByte, 2 * kEdgesPerFrame);
      for (const Field& field : row.fields) {
        if (is_on_page(field, page)) reserved &= ~bytes_mask(field.start_bit / 8U, (field.bits + 7U) / 8U);
      }
    }
  }
  return layouts;
}();

}  // namespace layout_detail

/// The layout of an element of kMessages.
inline const Layout& layout_of(const MessageRow& row) noexcept {
  return layout_detail::kLayouts[static_cast<std::size_t>(&row - kMessages.data())];
}

}  // namespace drivebench::can
