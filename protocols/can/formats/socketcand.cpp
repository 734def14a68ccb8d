#include "protocols/can/formats/socketcand.hpp"

#include <algorithm>
#include <cstdint>

#include "protocols/can/formats/text.hpp"

namespace drivebench::can {
namespace {

enum Flag : std::uint32_t { kBitRateSwitch = 1, kErrorState = 2, kFdFormat = 4 };

std::uint32_t flags_of(const Frame& frame) {
  return (frame.bit_rate_switch ? kBitRateSwitch : 0u) | (frame.error_state ? kErrorState : 0u);
}

bool take_flags(std::string_view word, Frame& frame) {
  const auto flags = parse_number(word, 16);
  if (!flags || (*flags & ~(kBitRateSwitch | kErrorState | kFdFormat)) != 0) return false;
  frame.fd = true;
  frame.bit_rate_switch = (*flags & kBitRateSwitch) != 0;
  frame.error_state = (*flags & kErrorState) != 0;
  return true;
}

bool take_id(std::string_view word, Frame& frame) {
  const auto number = parse_number<std::uint64_t>(word, 16);
  if (!number || (*number >> 32 != 0 && *number >> 31 != 0x1FFFFFFFFu)) return false;
  const auto id = static_cast<std::uint32_t>(*number);
  const bool flagged = id >> 31 != 0;
  frame.id = id & 0x7FFFFFFF;
  frame.extended = flagged || word.size() == 8 || frame.id > kMaxStandardId;
  return true;
}

bool take_size(std::string_view word, Frame& frame) {
  const auto size = parse_number<std::uint8_t>(word, 10);
  if (!size || *size > frame.data.size()) return false;
  frame.size = *size;
  return true;
}

/// Reads a byte, also in sign-extended form.
bool take_byte(std::string_view word, std::uint8_t& byte) {
  const auto number = parse_number<std::uint64_t>(word, 16);
  if (!number) return false;
  byte = static_cast<std::uint8_t>(*number);
  const auto negative = ~std::uint64_t{0} << 7;
  return *number <= 0xFF || (*number & negative) == negative ||
         (*number & negative) == (negative & 0xFFFFFFFF);
}

}  // namespace

std::string_view take_word(std::string_view& rest) noexcept {
  rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
  const std::string_view word = rest.substr(0, rest.find(' '));
  rest.remove_prefix(word.size());
  return word;
}

void append_socketcand_frame(std::string& out, const Frame& frame, double time_s) {
  out += frame.error ? "< error " : frame.remote ? "< rtr " : frame.fd ? "< fdframe " : "< frame ";
  append_id(out, frame);
  if (frame.fd) {
    out += ' ';
    append_hex(out, flags_of(frame), 2);
  }
  out += ' ';
  append_time(out, time_s);
  out += ' ';
  if (frame.remote) {
    out += std::to_string(frame.size);
  } else if (!frame.error) {
    append_data(out, frame);
  }
  out += frame.error ? ">" : " >";
}

void append_socketcand_send(std::string& out, const Frame& frame) {
  if (frame.error) return;
  out += frame.remote ? "< sendrtr " : frame.fd ? "< fdsend " : "< send ";
  append_id(out, frame);
  if (frame.fd) {
    out += ' ';
    append_hex(out, flags_of(frame), 2);
  }
  out += ' ';
  out += std::to_string(frame.size);
  for (std::size_t i = 0; i < frame.size && !frame.remote; ++i) {
    out += ' ';
    append_hex(out, frame.data[i], 2);
  }
  out += " >";
}

std::optional<TimedFrame> parse_socketcand_frame(std::string_view element) noexcept {
  TimedFrame timed;
  Frame& frame = timed.frame;
  const std::string_view kind = take_word(element);
  if (kind != "frame" && kind != "rtr" && kind != "fdframe") return std::nullopt;
  frame.remote = kind == "rtr";
  if (!take_id(take_word(element), frame)) return std::nullopt;
  if (kind == "fdframe" && !take_flags(take_word(element), frame)) return std::nullopt;
  const auto time = parse_time(take_word(element));
  if (!time) return std::nullopt;
  timed.time_s = *time;
  const std::string_view last = take_word(element);
  if (!(frame.remote ? take_size(last, frame) : parse_data(last, frame))) return std::nullopt;
  if (!take_word(element).empty() || !is_possible(frame)) return std::nullopt;
  return timed;
}

std::optional<Frame> parse_socketcand_send(std::string_view element) noexcept {
  Frame frame;
  const std::string_view kind = take_word(element);
  if (kind != "send" && kind != "sendrtr" && kind != "fdsend") return std::nullopt;
  frame.remote = kind == "sendrtr";
  if (!take_id(take_word(element), frame)) return std::nullopt;
  if (kind == "fdsend" && !take_flags(take_word(element), frame)) return std::nullopt;
  if (!take_size(take_word(element), frame)) return std::nullopt;
  for (std::size_t i = 0; i < frame.size && !frame.remote; ++i) {
    if (!take_byte(take_word(element), frame.data[i])) return std::nullopt;
  }
  if (!take_word(element).empty() || !is_possible(frame)) return std::nullopt;
  return frame;
}

std::optional<SocketcandReader::Element> SocketcandReader::push(char byte) noexcept {
  const bool blank = byte == ' ' || byte == '\n' || byte == '\r' || byte == '\t';
  if (byte == '<') {
    bad_ = bad_ || inside_;
    inside_ = true;
    size_ = 0;
  } else if (!inside_) {
    bad_ = bad_ || !blank;
  } else if (byte != '>') {
    if (size_ < text_.size()) {
      text_[size_++] = blank ? ' ' : byte;
    } else {
      bad_ = true;
    }
  } else {
    std::string_view text(text_.data(), size_);
    text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
    text = text.substr(0, text.find_last_not_of(' ') + 1);
    const Element element{text, bad_};
    inside_ = false;
    bad_ = false;
    return element;
  }
  return std::nullopt;
}

}  // namespace drivebench::can
