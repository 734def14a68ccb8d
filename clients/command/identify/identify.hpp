#pragma once

#include "clients/command/identify/data/identify_options.hpp"

namespace drivebench::command {

int run_identify(const IdentifyOptions& options);

}  // namespace drivebench::command
