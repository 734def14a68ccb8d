#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

namespace drivebench::web {

/// A verb of `drivebench`, such as `test`, that runs as a program of its own.
struct Verb {
  std::vector<std::string> arguments{};    ///< from its name on
  std::vector<std::string> environment{};  ///< NAME=VALUE, in the place of the gateway's
  std::filesystem::path complaints{};      ///< a file for its standard error
  std::filesystem::path folder{};          ///< where it starts; empty: where the gateway did
};

struct VerbEnd {
  int code = 0;             ///< exit code; 128 + n after signal n
  std::string complaint{};  ///< the last line of its standard error
};

using SeeLine = std::function<void(std::string_view line)>;

/// Runs a verb to its end, or ends it on `stop`, and everything that it has started. `see` gets each line of
/// its output. Throws std::system_error if it cannot be started.
using RunVerb = std::function<VerbEnd(const Verb& verb, const SeeLine& see, const std::stop_token& stop)>;

}  // namespace drivebench::web
