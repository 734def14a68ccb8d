#include "protocols/can/formats/candump.hpp"

#include <cstdint>

#include "protocols/can/formats/text.hpp"

namespace drivebench::can {
namespace {

/// As in linux/can.h.
constexpr std::uint32_t kErrorFlag = 0x20000000;
enum FdFlag : std::uint32_t { kFdBitRateSwitch = 1, kFdErrorState = 2 };

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
      append_hex(
          out, (frame.bit_rate_switch ? kFdBitRateSwitch : 0u) | (frame.error_state ? kFdErrorState : 0u), 1);
    }
    append_data(out, frame);
  }
  out += '\n';
}

}  // namespace drivebench::can
