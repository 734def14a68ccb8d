#pragma once

#include "clients/command/common/session/link_choice.hpp"

namespace drivebench::command {

struct StatusOptions {
  LinkChoice link{};
  bool json = false;
};
int run_status(const StatusOptions& options);

}  // namespace drivebench::command
