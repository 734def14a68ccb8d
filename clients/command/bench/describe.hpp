#pragma once

#include "clients/command/common/session/link_choice.hpp"

namespace drivebench::command {

struct DescribeOptions {
  LinkChoice link{};
  bool json = false;
};
int run_describe(const DescribeOptions& options);

}  // namespace drivebench::command
