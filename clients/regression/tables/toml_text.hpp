#pragma once

#include <string>

#include "protocols/document.hpp"

namespace drivebench::regression {

/// A table as a TOML document: parse_document() of it gives the same table. Its scalars must be of types that
/// configurations use.
std::string toml_text(const ConfigNode& table);

/// A scalar or an array as TOML writes it in a line.
std::string toml_value(const ConfigNode& value);

}  // namespace drivebench::regression
