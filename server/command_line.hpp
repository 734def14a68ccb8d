#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace drivebench {

/// The command line of the server.
struct ServerOptions {
  std::string config;
  std::string mode;
  std::string replay;
  std::string from;    ///< a saved state to begin with
  std::string repeat;  ///< a recording to begin with, up to `until`
  std::int64_t until = -1;
  std::string record;
  std::string unix_path;
  int port = -1;
  int command_delay_ticks = -1;
  double duration_s = 0.0;
  std::int64_t fail_on_late = -1;
  bool json = false;
  bool check_config = false;
  bool allow_overload = false;
  bool allow_odd = false;
  std::string experiments;
  std::string audit;
  std::string log_format = "text";
  double file_s = 0.0;         ///< plant time in each file of a recording; 0: no limit
  std::uint64_t file_mib = 0;  ///< size of each file of a recording; 0: no limit
  double chunk_ms = 0.0;       ///< plant time that a kill may cost a recording; 0: the default
  bool require_realtime = false;
  int spin_us = 0;               ///< for so long the I/O thread looks for more before it sleeps
  bool measure_answers = false;  ///< for the verdict in JSON
  std::string messages;          ///< a file of messages to the device under test
  std::string lines;             ///< takes those that are lines
  std::string print;             ///< prints the description of an interface instead of a run
  std::size_t bus = 1;
};

/// Reads the command line. Has a value if the program ends here: whether it did what was asked (--help).
std::optional<bool> read_command_line(int argc, char** argv, ServerOptions& o);

}  // namespace drivebench
