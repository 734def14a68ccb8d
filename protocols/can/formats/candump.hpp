#pragma once

#include <string>
#include <string_view>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// Appends a line of the log format of candump -l, which can-utils, python-can, SavvyCAN and Wireshark read:
/// "(1436509052.249713) vcan0 044#2A366C2BBA". FD frames have "##" and a digit for their flags, remote frames
/// "#R" and their size. `interface` must not hold spaces or line ends.
void append_candump(std::string& out, double time_s, std::string_view interface, const Frame& frame);

}  // namespace drivebench::can
