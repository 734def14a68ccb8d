#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// The text protocol of socketcand, a daemon that shares a CAN bus over TCP: elements "< word ... >" one
/// after another. The server greets with "< hi >"; "< open NAME >" and "< rawmode >" are answered with
/// "< ok >"; then frames flow:
///
///   to the server    < send ID SIZE B B .. >   < sendrtr ID SIZE >   < fdsend ID FLAGS SIZE B B .. >
///   to the client    < frame ID TIME BBBB >    < rtr ID TIME SIZE >  < fdframe ID FLAGS TIME BBBB >
///
/// IDs, bytes B and FLAGS (1: bit rate switch, 2: error state) are hexadecimal, sizes decimal, times are
/// seconds with six digits. An identifier of eight digits is extended. Debian's python-can 4.1.0 writes no
/// leading zeros, so that its extended identifiers below 0x800 arrive as standard ones; it treats every
/// received identifier as extended.

/// The length of the longest element without its brackets.
inline constexpr std::size_t kMaxSocketcandElement = 320;

/// A frame and its time on the bus [s since 1970].
struct TimedFrame {
  Frame frame;
  double time_s = 0.0;
};

/// Append one element. An error frame becomes "< error CLASS TIME >" for the client and nothing for a server.
void append_socketcand_frame(std::string& out, const Frame& frame, double time_s);
void append_socketcand_send(std::string& out, const Frame& frame);

/// Read the text between the brackets. Nothing for any other element, an error frame or a frame that no bus
/// can carry.
std::optional<TimedFrame> parse_socketcand_frame(std::string_view element) noexcept;
/// Also accepts identifiers and bytes of SavvyCAN: sign-extended numbers with all leading Fs, and bit 31 of
/// the identifier for an extended one.
std::optional<Frame> parse_socketcand_send(std::string_view element) noexcept;

/// Cuts a byte stream into elements.
class SocketcandReader {
 public:
  struct Element {
    std::string_view text;  ///< between the brackets, without spaces at its ends; valid until the next byte
    bool bad = false;       ///< too long, or bytes stand outside of brackets
  };

  /// Takes a byte and returns the element that it ends, if any.
  std::optional<Element> push(char byte) noexcept;

 private:
  std::array<char, kMaxSocketcandElement> text_{};
  std::size_t size_ = 0;
  bool inside_ = false;
  bool bad_ = false;
};

/// Takes the next word off the front of an element; empty at its end.
std::string_view take_word(std::string_view& rest) noexcept;

}  // namespace drivebench::can
