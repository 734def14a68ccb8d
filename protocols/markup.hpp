#pragma once

#include <string>
#include <string_view>

namespace drivebench {

/// The text as content or attribute of XML, SVG and HTML: valid UTF-8, its marks escaped, '?' for each
/// control character that XML 1.0 does not have.
std::string markup(std::string_view text);

}  // namespace drivebench
