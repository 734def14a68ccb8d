#pragma once

#include "protocols/pages/write_pages.hpp"

namespace drivebench::command {

/// What the pages of `drivebench` say beside its command line.
pages::Program program_of_pages();

}  // namespace drivebench::command
