#include "protocols/can/codec.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "protocols/can/layout.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::can {
namespace {

static_assert(32767 * kDutyUnit == 1.0, "the full duty is exactly 1");

// ---- keys of match() ----

/// The part of a message that match() needs, small because match() may look at every message.
struct Key {
  /// The rows of a message in one variant of the profile.
  struct Rows {
    std::uint8_t count = 0;
    std::array<std::uint8_t, 2> index{};  ///< in kMessages; the second one is for wide axes
    bool only_wide = false;

    constexpr void add(std::size_t i) {
      if (count == 0) only_wide = kMessages[i].width == Width::kWide;
      index.at(count++) = static_cast<std::uint8_t>(i);
    }
  };

  Message message{};
  bool per_node = false;
  std::array<Rows, 2> rows{};  ///< of the classic profile, of the FD profile

  constexpr bool only_wide() const { return rows[0].only_wide || rows[1].only_wide; }
};

/// The messages that a bus carries in every tick; match() looks at these first.
constexpr std::array kInEveryTick = {Message::kSensors, Message::kCommand, Message::kCurrents,
                                     Message::kEncoder, Message::kEdges,   Message::kSync};

/// Messages that only wide axes have come last: on a bus without such axes their identifiers may belong to
/// others.
constexpr auto kKeys = [] {
  std::array<Key, kMessageCount> keys{};
  for (std::size_t m = 0; m < kMessageCount; ++m)
    keys[m].message = static_cast<Message>(m);
  for (std::size_t i = 0; i < kMessages.size(); ++i) {
    Key& key = keys[static_cast<std::size_t>(kMessages[i].message)];
    key.per_node = kMessages[i].per_node;
    if (is_in(kMessages[i], false)) key.rows[0].add(i);
    if (is_in(kMessages[i], true)) key.rows[1].add(i);
  }
  std::ranges::sort(keys, {}, [](const Key& key) {
    const auto often = std::ranges::find(kInEveryTick, key.message) - kInEveryTick.begin();
    return (key.only_wide() ? 2 * kMessageCount : 0) + static_cast<std::size_t>(often);
  });
  return keys;
}();

constexpr std::size_t kCommandMode = index_of(Message::kCommand, false, "mode");
static_assert(kCommandMode == index_of(Message::kPhaseCommand, false, "mode", true));

constexpr bool is_classic_command(const MessageRow& row, const Profile& profile) noexcept {
  return !profile.fd && (row.message == Message::kCommand || row.message == Message::kPhaseCommand);
}

// ---- numbers ----

constexpr std::uint64_t all_ones(unsigned bits) noexcept {
  return ~std::uint64_t{0} >> (64 - bits);
}

/// std::llround without the call, which would cost more than the rest of a field. |value| < 2^63.
std::int64_t rounded(double value) noexcept {
  const auto whole = static_cast<std::int64_t>(value);
  const double rest = value - static_cast<double>(whole);  // exact
  return whole + (rest >= 0.5 ? 1 : 0) - (rest <= -0.5 ? 1 : 0);
}

/// The low bits of an integer of any size.
std::uint64_t wrapped(double value) noexcept {
  constexpr double kLimit = 0x1p63;
  if (std::abs(value) < kLimit) return static_cast<std::uint64_t>(rounded(value));
  if (!std::isfinite(value)) return 0;
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::fmod(value, 0x1p32)));
}

/// Rounds and limits to two bounds that a double holds exactly; NaN becomes the lower bound.
std::int64_t clamped(double value, std::int64_t low, std::int64_t high) noexcept {
  if (!(value > static_cast<double>(low))) return low;
  if (value >= static_cast<double>(high)) return high;
  return rounded(value);
}

float single(double value) noexcept {
  constexpr auto kLargest = static_cast<double>(std::numeric_limits<float>::max());
  if (value > kLargest) return std::numeric_limits<float>::infinity();
  if (value < -kLargest) return -std::numeric_limits<float>::infinity();
  return static_cast<float>(value);
}

std::uint64_t raw_of(const Field& field, double value, double unit) noexcept {
  const auto ones = static_cast<std::int64_t>(all_ones(field.bits));
  switch (field.encoding) {
    case Encoding::kCounter:
    case Encoding::kSigned:
      return wrapped(value);
    case Encoding::kCode:
      return static_cast<std::uint64_t>(clamped(value, 0, ones));
    case Encoding::kUScaled:
      return static_cast<std::uint64_t>(std::isnan(value) ? ones : clamped(value / unit, 0, ones - 1));
    case Encoding::kScaled: {
      const std::int64_t largest = ones >> 1;
      return static_cast<std::uint64_t>(std::isnan(value) ? -largest - 1
                                                          : clamped(value / unit, -largest, largest));
    }
    case Encoding::kFloat:
      break;
  }
  return std::bit_cast<std::uint32_t>(single(value));
}

double value_of_single(std::uint64_t raw) noexcept {
  return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
}

double value_of(const Field& field, std::uint64_t raw, double unit) noexcept {
  constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();
  const std::int64_t number = unwrap(raw, field.bits, 0);
  switch (field.encoding) {
    case Encoding::kCounter:
    case Encoding::kCode:
      return static_cast<double>(raw);
    case Encoding::kSigned:
      return static_cast<double>(number);
    case Encoding::kUScaled:
      return raw == all_ones(field.bits) ? kNoValue : static_cast<double>(raw) * unit;
    case Encoding::kScaled:
      return number == -1 - static_cast<std::int64_t>(all_ones(field.bits) >> 1)
                 ? kNoValue
                 : static_cast<double>(number) * unit;
    case Encoding::kFloat:
      break;
  }
  return value_of_single(raw);
}

/// The value of one count of a set-point in a classic command whose mode gives duties or currents; 0 in the
/// other modes.
double setpoint_unit(const Profile& profile, double mode) noexcept {
  if (mode == double{kDutyMode} || mode == double{kLegDutyMode}) return kDutyUnit;
  return mode == double{kCurrentMode} ? profile.current_unit_a : 0.0;
}

/// The value of one count of a field; `setpoint` is setpoint_unit() of the frame, or 0.
double unit_of(const Field& field, const Profile& profile, double setpoint) noexcept {
  if (field.scale == Unit::kNone) return 1.0;
  return setpoint != 0.0 ? setpoint : profile.unit_of(field.scale);
}

// ---- bytes ----

// Both become one move: the loop at any level, the shifts where a loop would not.
template <unsigned kBytes>
void put_bytes(std::uint8_t* at, std::uint64_t raw) noexcept {
  for (unsigned i = 0; i < kBytes; ++i)
    at[i] = static_cast<std::uint8_t>(raw >> 8 * i);
}
template <unsigned kBytes>
std::uint64_t get_bytes(const std::uint8_t* at) noexcept {
  const auto joined = [at]<unsigned... i>(std::integer_sequence<unsigned, i...>) noexcept {
    return ((std::uint32_t{at[i]} << 8 * i) | ...);
  };
  return joined(std::make_integer_sequence<unsigned, kBytes>{});
}

void put(Frame& frame, const Field& field, std::uint64_t raw) noexcept {
  std::uint8_t* const at = &frame.data[field.start_bit / 8U];
  if (field.bits == 8) return put_bytes<1>(at, raw);
  if (field.bits == 16) return put_bytes<2>(at, raw);
  if (field.bits == 4) {
    *at = static_cast<std::uint8_t>(*at | raw << field.start_bit % 8U);
    return;
  }
  put_bytes<4>(at, raw);
}

std::uint64_t get(const Frame& frame, const Field& field) noexcept {
  const std::uint8_t* const at = &frame.data[field.start_bit / 8U];
  if (field.bits == 8) return get_bytes<1>(at);
  if (field.bits == 16) return get_bytes<2>(at);
  if (field.bits == 4) return get_bytes<1>(at) >> field.start_bit % 8U & 0xFU;
  return get_bytes<4>(at);
}

FrameProblem problem_of(const MessageRow& row, const Profile& profile, const Frame& frame) noexcept {
  if (frame.extended != profile.extended) return FrameProblem::kWrongFormat;
  if (frame.remote) return FrameProblem::kRemote;
  if (frame.fd && !profile.fd) return FrameProblem::kWrongKind;
  if (!frame.fd && row.variant == Variant::kFd) return FrameProblem::kWrongKind;
  if (frame.size != row.size) return FrameProblem::kWrongSize;
  const Layout& layout = layout_of(row);
  const std::size_t page = layout.paged ? std::min<std::size_t>(frame.data[0], kPages) : 0;
  for (std::uint64_t left = layout.reserved[page]; left != 0; left &= left - 1) {
    if (frame.data[static_cast<std::size_t>(std::countr_zero(left))] != 0) return FrameProblem::kReserved;
  }
  return FrameProblem::kNone;
}

Frame empty_frame(const MessageRow& row, const Profile& profile, std::uint32_t node) noexcept {
  Frame frame;
  frame.id = profile.id_of(row, node);
  frame.extended = profile.extended;
  frame.fd = frame.bit_rate_switch = profile.fd;
  frame.size = row.size;
  return frame;
}

/// raw_of() of a signal's value; integers do not pass through a double.
std::uint64_t raw_of(const Field& field, const Signal& signal, const Sample& sample,
                     const Profile& profile) noexcept {
  if (signal.type == SignalType::kReal)
    return raw_of(field, sample.*signal.as_real, profile.unit_of(field.scale));
  if (signal.type == SignalType::kSigned) return static_cast<std::uint64_t>(sample.*signal.as_signed);
  const std::uint64_t word = sample.*signal.as_unsigned;
  return field.encoding == Encoding::kCode ? std::min(word, all_ones(field.bits)) : word;
}

}  // namespace

Frame encode(const MessageRow& row, const Profile& profile, std::uint32_t node,
             std::span<const double> values) noexcept {
  Frame frame = empty_frame(row, profile, node);
  const double setpoint =
      is_classic_command(row, profile) ? setpoint_unit(profile, values[kCommandMode]) : 0.0;
  const std::uint64_t page = layout_of(row).paged ? raw_of(row.fields[0], values[0], 1.0) : 0;
  for (std::size_t i = 0; i < row.fields.size(); ++i) {
    const Field& field = row.fields[i];
    if (is_on_page(field, page))
      put(frame, field, raw_of(field, values[i], unit_of(field, profile, setpoint)));
  }
  return frame;
}

Values decode(const MessageRow& row, const Profile& profile, const Frame& frame) noexcept {
  Values values;
  const Layout& layout = layout_of(row);
  const double setpoint =
      is_classic_command(row, profile)
          ? setpoint_unit(profile, static_cast<double>(get(frame, row.fields[kCommandMode])))
          : 0.0;
  const std::uint8_t page = frame.data[0];
  for (const auto [i, byte] : std::span(layout.float_fields).first(layout.float_count))
    values[i] = value_of_single(get_bytes<4>(&frame.data[byte]));
  for (const std::uint8_t i : std::span(layout.coded_fields).first(layout.coded_count)) {
    const Field& field = row.fields[i];
    values[i] =
        is_on_page(field, page) ? value_of(field, get(frame, field), unit_of(field, profile, setpoint)) : 0.0;
  }
  std::fill(values.begin() + static_cast<std::ptrdiff_t>(row.fields.size()), values.end(), 0.0);
  return values;
}

Values values_of(const MessageRow& row, const Sample& sample) noexcept {
  Values values{};
  const Layout& layout = layout_of(row);
  for (std::size_t i = 0; i < row.fields.size(); ++i) {
    if (layout.signals[i] != nullptr) values[i] = drivebench::value_of(*layout.signals[i], sample);
  }
  return values;
}

Frame encode_sample(const MessageRow& row, const Profile& profile, std::uint32_t node, const Sample& sample,
                    Page page) noexcept {
  Frame frame = empty_frame(row, profile, node);
  const Layout& layout = layout_of(row);
  const auto number = static_cast<std::uint8_t>(page);
  if (layout.paged) frame.data[0] = number;
  for (const SingleField& each : std::span(layout.singles).first(layout.single_count))
    put_bytes<4>(&frame.data[each.byte], std::bit_cast<std::uint32_t>(single(sample.*each.signal)));
  for (const auto& [field, signal] : std::span(layout.others).first(layout.other_count)) {
    if (is_on_page(*field, number)) put(frame, *field, raw_of(*field, *signal, sample, profile));
  }
  return frame;
}

void update_sample(const MessageRow& row, std::span<const double> values, Sample& sample) noexcept {
  const Layout& layout = layout_of(row);
  for (std::size_t i = 0; i < row.fields.size(); ++i) {
    const Field& field = row.fields[i];
    if (layout.signals[i] == nullptr || (layout.paged && !is_on_page(field, wrapped(values[0])))) continue;
    const Signal& signal = *layout.signals[i];
    const bool wraps = field.encoding == Encoding::kCounter || field.encoding == Encoding::kSigned;
    if (signal.type == SignalType::kReal) {
      sample.*signal.as_real = values[i];
    } else if (signal.type == SignalType::kSigned) {
      std::int64_t& number = sample.*signal.as_signed;
      number = unwrap(wrapped(values[i]), field.bits, wraps ? number : 0);
    } else {
      std::uint64_t& number = sample.*signal.as_unsigned;
      const std::uint64_t low_bits = wrapped(values[i]) & all_ones(field.bits);
      const std::int64_t near = unwrap(low_bits, field.bits, static_cast<std::int64_t>(number));
      number = wraps && near >= 0 ? static_cast<std::uint64_t>(near) : low_bits;
    }
  }
}

std::string_view name_of(FrameProblem problem) noexcept {
  constexpr std::array<std::string_view, kFrameProblems> kNames = {
      "none", "error_frame", "foreign", "wrong_format", "remote", "wrong_kind", "wrong_size", "reserved"};
  return kNames[static_cast<std::size_t>(problem)];
}

Match match(const Profile& profile, const Frame& frame) noexcept {
  if (frame.error) return {nullptr, 0, FrameProblem::kError};
  const std::uint32_t max_node = profile.max_node();
  for (const Key& key : kKeys) {
    const std::uint32_t node = frame.id - profile.base_ids[static_cast<std::size_t>(key.message)];
    if (key.per_node ? node < 1 || node > max_node : node != 0) continue;
    const Key::Rows& rows = key.rows[profile.fd ? 1 : 0];
    if (rows.count == 0 || (rows.only_wide && !profile.wide)) continue;
    const MessageRow* row = &kMessages[rows.index[0]];
    if (profile.wide && rows.count == 2 && frame.size == kMessages[rows.index[1]].size)
      row = &kMessages[rows.index[1]];
    return {row, node, problem_of(*row, profile, frame)};
  }
  return {};
}

void put_edge(Frame& frame, std::size_t index, Edge edge) noexcept {
  put_bytes<2>(&frame.data[kFirstEdgeByte + 2 * index], (edge.time & 0x7FFFU) | (edge.down ? 0x8000U : 0U));
}

}  // namespace drivebench::can
