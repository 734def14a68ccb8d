#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "protocols/pages/line_description.hpp"

namespace drivebench::pages {

/// What --help prints about a verb, in lines of 80 columns: its text, how it is called, its arguments and
/// options under their headings, examples, exit codes.
std::string help_text(const LineVerb& verb);

/// The text and an end of line, in lines of 80 columns that start at `column`, but the first, which starts
/// where the caller is. A word that is too long for a line has one of its own.
std::string wrapped(std::string_view text, std::size_t column);

}  // namespace drivebench::pages
