#pragma once

#include <string>

namespace drivebench::command {

struct DemoOptions {
  bool json = false;
  std::string folder = "recordings";
};
int run_demo(const DemoOptions& options);

}  // namespace drivebench::command
