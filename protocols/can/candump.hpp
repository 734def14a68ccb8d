#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// The log format of candump -l; can-utils, python-can, SavvyCAN and Wireshark read it.

/// Appends a line with its end: "(1436509052.249713) vcan0 044#2A366C2BBA"; FD frames have "##" and a digit
/// for their flags, remote frames "#R" and their size. `interface` holds neither spaces nor line ends.
void append_candump(std::string& out, double time_s, std::string_view interface, const Frame& frame);

struct CandumpLine {
  double time_s = 0.0;
  std::string_view interface;  ///< a view into the line
  Frame frame;
};

/// Reads one line, with or without line end and direction (" R", " T"). Nothing if the line has any other
/// form.
std::optional<CandumpLine> parse_candump(std::string_view line) noexcept;

}  // namespace drivebench::can
