#pragma once

#include <filesystem>
#include <string_view>

namespace drivebench {

/// The folder that a file URI names, as FMI 2 gives the resources: file:///path or file:/path, with %20 and
/// the like. A text that is no URI is taken for a path. Throws std::invalid_argument for another scheme,
/// another host and broken escapes.
std::filesystem::path folder_of_uri(std::string_view uri);

}  // namespace drivebench
