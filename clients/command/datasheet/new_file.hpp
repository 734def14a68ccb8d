#pragma once

#include <string>

#include "clients/command/datasheet/sheet.hpp"

namespace drivebench::command {

/// Throws UsageError if there is a file of this name already: it may hold a user's own changes.
void check_new_file(const std::string& path);
/// Writes a file, or standard output without a name.
void write_new_file(const std::string& path, const std::string& text);
/// A text for TOML must be plain and stay in its line. Throws UsageError.
void check_text(const char* option, const std::string& text);

/// The comment and the value below it.
std::string text_of(const FileLine& line);

}  // namespace drivebench::command
