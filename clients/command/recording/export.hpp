#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace drivebench::command {

/// The exit code for a recording that has no end or lost entries; its content was written.
inline constexpr int kExitCutShort = 3;

struct ExportOptions {
  std::string recording{};
  bool json = false;
  std::string out_file{};              ///< empty: standard output
  std::string axis{};                  ///< name; empty: the first in the file
  std::vector<std::string> signals{};  ///< empty: all
  std::uint64_t from_tick = 0;
  std::uint64_t to_tick = std::numeric_limits<std::uint64_t>::max();
  std::string format{};            ///< csv, mat, mdf or candump; empty: as the name of the file ends
  std::string interface = "can0";  ///< candump: its name in every line
  unsigned node_base = 1;          ///< candump: node id of the first axis
  bool classic = false;            ///< candump: classic frames instead of FD
  std::string profile{};           ///< candump: keys of a can: address
};
int run_export(const ExportOptions& options);

}  // namespace drivebench::command
