// A frame that a CAN format reads is one that a bus can carry, and reads back equal after it was written. The
// same bytes go to all formats.
#include <algorithm>
#include <array>
#include <string>

#include "protocols/can/formats/msgpack.hpp"
#include "protocols/can/formats/slcan.hpp"
#include "protocols/can/formats/socketcand.hpp"
#include "protocols/can/formats/text.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace drivebench::can {
namespace {

using fuzz::require;

void check_msgpack(std::span<const std::byte> bytes) {
  const auto frame = decode_msgpack(bytes);
  if (!frame) return;
  require(is_possible(*frame), "a bus can carry a frame from a map");
  std::array<std::byte, kMaxMsgpackFrame> out;
  const std::size_t size = encode_msgpack(*frame, 1.0, out);
  Frame expected = *frame;
  if (expected.remote) expected.data = {};
  require(size > 0 && decode_msgpack(std::span(out).first(size)) == expected, "a map reads back equal");
}

void check_slcan(std::string_view text) {
  SlcanReader reader;
  for (const char byte : text) {
    const auto line = reader.push(byte);
    if (!line) continue;
    require(line->text.size() <= kMaxSlcanLine, "a line is bounded");
    const auto frame = parse_slcan(line->text);
    if (!frame) continue;
    require(is_possible(*frame), "a bus can carry a frame from a line");
    std::string out;
    append_slcan(out, *frame);
    require(!out.empty() && out.back() == kSlcanOk, "a line has an end");
    out.pop_back();
    require(parse_slcan(out) == *frame, "a line reads back equal");
  }
}

void check_socketcand(std::string_view text) {
  SocketcandReader reader;
  for (const char byte : text) {
    const auto element = reader.push(byte);
    if (!element) continue;
    require(element->text.size() <= kMaxSocketcandElement, "an element is bounded");
    std::string out;
    if (const auto frame = parse_socketcand_send(element->text)) {
      append_socketcand_send(out, *frame);
      require(is_possible(*frame) && parse_socketcand_send(out.substr(2, out.size() - 4)) == *frame,
              "a frame to the server reads back equal");
    } else if (const auto timed = parse_socketcand_frame(element->text)) {
      append_socketcand_frame(out, timed->frame, timed->time_s);
      const auto again = parse_socketcand_frame(out.substr(2, out.size() - 4));
      require(is_possible(timed->frame) && again && again->frame == timed->frame,
              "a frame to a client reads back equal");
    }
  }
}

}  // namespace
}  // namespace drivebench::can

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  const auto bytes = fuzz::as_bytes_of(data, size);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  can::check_msgpack(bytes);
  can::check_slcan(text);
  can::check_socketcand(text);
  return 0;
}
