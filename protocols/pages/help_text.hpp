#pragma once

#include <string>

#include "protocols/pages/line_description.hpp"

namespace drivebench::pages {

/// What --help prints about a verb, in lines of 80 columns: its text, how it is called, its arguments and
/// options under their headings, examples, exit codes.
std::string help_text(const LineVerb& verb);

}  // namespace drivebench::pages
