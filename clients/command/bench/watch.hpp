#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "clients/command/common/session/link_choice.hpp"

namespace drivebench::command {

struct WatchOptions {
  LinkChoice link{};
  bool json = false;
  std::string axis = "0";              ///< number or name
  std::vector<std::string> signals{};  ///< empty: the usual ones of the axis
  std::optional<double> rate_hz{};     ///< in the bench's time; else as the mode needs it
  std::uint64_t count = 0;             ///< 0: until interrupted
};
int run_watch(const WatchOptions& options);

}  // namespace drivebench::command
