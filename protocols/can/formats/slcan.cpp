#include "protocols/can/formats/slcan.hpp"

#include <algorithm>
#include <span>

#include "protocols/can/formats/text.hpp"

namespace drivebench::can {
namespace {

struct Kind {
  char letter;
  bool extended, remote, fd, bit_rate_switch;
};
constexpr std::array<Kind, 8> kKinds{{{'t', false, false, false, false},
                                      {'T', true, false, false, false},
                                      {'r', false, true, false, false},
                                      {'R', true, true, false, false},
                                      {'d', false, false, true, false},
                                      {'D', true, false, true, false},
                                      {'b', false, false, true, true},
                                      {'B', true, false, true, true}}};

struct BitRate {
  std::int64_t bit_rate;
  std::string_view command;
};
// Without S7: 800 kbit/s in Lawicel's adapters, 750 kbit/s in others.
constexpr std::array<BitRate, 8> kBitRates{{{10'000, "S0"},
                                            {20'000, "S1"},
                                            {50'000, "S2"},
                                            {100'000, "S3"},
                                            {125'000, "S4"},
                                            {250'000, "S5"},
                                            {500'000, "S6"},
                                            {1'000'000, "S8"}}};
constexpr std::array<BitRate, 4> kDataBitRates{
    {{1'000'000, "Y1"}, {2'000'000, "Y2"}, {4'000'000, "Y4"}, {5'000'000, "Y5"}}};

std::optional<std::string_view> find(std::span<const BitRate> table, std::int64_t bit_rate) {
  const auto row = std::ranges::find(table, bit_rate, &BitRate::bit_rate);
  if (row == table.end()) return std::nullopt;
  return row->command;
}

}  // namespace

void append_slcan(std::string& out, const Frame& frame, std::optional<std::uint16_t> stamp_ms) {
  const auto kind = std::ranges::find_if(kKinds, [&](const Kind& each) {
    return each.extended == frame.extended && each.remote == frame.remote && each.fd == frame.fd &&
           each.bit_rate_switch == frame.bit_rate_switch;
  });
  if (kind == kKinds.end() || frame.error || !is_possible(frame)) return;
  out.push_back(kind->letter);
  append_id(out, frame);
  const auto code = std::ranges::find(kFdSizes, frame.size) - kFdSizes.begin();
  append_hex(out, static_cast<std::uint32_t>(code), 1);
  if (!frame.remote) append_data(out, frame);
  if (stamp_ms) append_hex(out, *stamp_ms, 4);
  out.push_back(kSlcanOk);
}

std::optional<Frame> parse_slcan(std::string_view line) noexcept {
  if (line.empty()) return std::nullopt;
  const auto kind = std::ranges::find(kKinds, line.front(), &Kind::letter);
  if (kind == kKinds.end()) return std::nullopt;
  const std::size_t id_digits = kind->extended ? 8 : 3;
  if (line.size() < 1 + id_digits + 1) return std::nullopt;
  const auto id = parse_number(line.substr(1, id_digits), 16);
  const auto code = parse_number(line.substr(1 + id_digits, 1), 16);
  if (!id || !code || (!kind->fd && *code > 8)) return std::nullopt;
  Frame frame{.id = *id,
              .extended = kind->extended,
              .remote = kind->remote,
              .fd = kind->fd,
              .bit_rate_switch = kind->bit_rate_switch};
  const std::string_view rest = line.substr(1 + id_digits + 1);
  const std::size_t digits = frame.remote ? 0 : std::size_t{2} * kFdSizes[*code];
  const bool stamped = rest.size() == digits + 4;
  if (rest.size() != digits && !stamped) return std::nullopt;
  if (stamped && !parse_number(rest.substr(digits), 16)) return std::nullopt;
  if (!parse_data(rest.substr(0, digits), frame)) return std::nullopt;
  frame.size = kFdSizes[*code];
  if (!is_possible(frame)) return std::nullopt;
  return frame;
}

std::optional<std::string_view> slcan_bit_rate(std::int64_t bit_rate) noexcept {
  return find(kBitRates, bit_rate);
}

std::optional<std::string_view> slcan_data_bit_rate(std::int64_t data_bit_rate) noexcept {
  return find(kDataBitRates, data_bit_rate);
}

std::optional<SlcanReader::Line> SlcanReader::push(char byte) noexcept {
  if (byte == '\n') return std::nullopt;
  if (byte != kSlcanOk && byte != kSlcanRefused) {
    if (size_ < line_.size()) {
      line_[size_++] = byte;
    } else {
      too_long_ = true;
    }
    return std::nullopt;
  }
  const Line line{{line_.data(), size_}, byte == kSlcanRefused, too_long_};
  size_ = 0;
  too_long_ = false;
  return line;
}

}  // namespace drivebench::can
