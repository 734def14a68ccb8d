#include "protocols/can/candump.hpp"

#include <cstdint>

#include "protocols/can/text.hpp"

namespace drivebench::can {
namespace {

/// As in linux/can.h.
constexpr std::uint32_t kErrorFlag = 0x20000000;
enum FdFlag : std::uint32_t { kBitRateSwitch = 1, kErrorState = 2, kFdFormat = 4 };

bool parse_id(std::string_view text, Frame& frame) {
  const auto id = parse_number(text, 16);
  if (!id || (text.size() != 3 && text.size() != 8)) return false;
  frame.error = (*id & kErrorFlag) != 0 && text.size() == 8;
  frame.extended = text.size() == 8 && !frame.error;
  frame.id = frame.error ? *id & ~kErrorFlag : *id;
  return true;
}

bool parse_fd(std::string_view text, Frame& frame) {
  const auto flags = parse_number(text.substr(0, 1), 16);
  if (!flags || (*flags & ~(kBitRateSwitch | kErrorState | kFdFormat)) != 0) return false;
  frame.fd = true;
  frame.bit_rate_switch = (*flags & kBitRateSwitch) != 0;
  frame.error_state = (*flags & kErrorState) != 0;
  return parse_data(text.substr(1), frame);
}

bool parse_remote(std::string_view text, Frame& frame) {
  frame.remote = true;
  if (text.empty()) return true;
  const auto size = parse_number<std::uint8_t>(text, 10);
  frame.size = size.value_or(0);
  return size && text.size() == 1;
}

bool parse_frame(std::string_view text, Frame& frame) {
  const std::size_t mark = text.find('#');
  if (mark == std::string_view::npos || !parse_id(text.substr(0, mark), frame)) return false;
  const std::string_view rest = text.substr(mark + 1);
  bool good = false;
  if (rest.starts_with('#')) {
    good = parse_fd(rest.substr(1), frame);
  } else if (rest.starts_with('R')) {
    good = parse_remote(rest.substr(1), frame);
  } else {
    good = parse_data(rest, frame);
  }
  return good && is_possible(frame);
}

}  // namespace

void append_candump(std::string& out, double time_s, std::string_view interface, const Frame& frame) {
  out += '(';
  append_time(out, time_s);
  out += ") ";
  out += interface;
  out += ' ';
  if (frame.error) {
    append_hex(out, frame.id | kErrorFlag, 8);
  } else {
    append_id(out, frame);
  }
  out += '#';
  if (frame.remote) {
    out += 'R';
    if (frame.size != 0) append_hex(out, frame.size, 1);
  } else {
    if (frame.fd) {
      out += '#';
      append_hex(out, (frame.bit_rate_switch ? kBitRateSwitch : 0u) | (frame.error_state ? kErrorState : 0u),
                 1);
    }
    append_data(out, frame);
  }
  out += '\n';
}

std::optional<CandumpLine> parse_candump(std::string_view line) noexcept {
  if (line.ends_with('\n')) line.remove_suffix(1);
  if (line.ends_with('\r')) line.remove_suffix(1);
  if (line.ends_with(" R") || line.ends_with(" T")) line.remove_suffix(2);
  if (!line.starts_with('(')) return std::nullopt;
  CandumpLine parsed;
  const std::size_t bracket = line.find(") ");
  if (bracket == std::string_view::npos) return std::nullopt;
  const auto time = parse_time(line.substr(1, bracket - 1));
  if (!time) return std::nullopt;
  parsed.time_s = *time;
  const std::string_view rest = line.substr(bracket + 2);
  const std::size_t space = rest.find(' ');
  if (space == std::string_view::npos || space == 0) return std::nullopt;
  parsed.interface = rest.substr(0, space);
  if (!parse_frame(rest.substr(space + 1), parsed.frame)) return std::nullopt;
  return parsed;
}

}  // namespace drivebench::can
