#include "server/fmu/fmi_uri.hpp"

#include <charconv>
#include <stdexcept>
#include <string>

namespace drivebench {
namespace {

char unescaped(std::string_view digits) {
  unsigned value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  if (digits.size() != 2 || error != std::errc{} || end != digits.data() + 2 || value == 0) {
    throw std::invalid_argument("the resource location has a broken escape: %" + std::string(digits));
  }
  return static_cast<char>(value);
}

}  // namespace

std::filesystem::path folder_of_uri(std::string_view uri) {
  constexpr std::string_view kScheme = "file:";
  if (!uri.starts_with(kScheme)) {
    if (uri.find("://") == std::string_view::npos) return uri;
    throw std::invalid_argument("the resource location must be a file URI, not " + std::string(uri));
  }
  uri.remove_prefix(kScheme.size());
  if (uri.starts_with("//")) {
    uri.remove_prefix(2);
    if (uri.starts_with("localhost/")) uri.remove_prefix(std::string_view("localhost").size());
  }
  if (!uri.starts_with('/')) {
    throw std::invalid_argument("the resource location must name a folder of this computer");
  }
  std::string path;
  for (std::size_t at = 0; at < uri.size(); ++at) {
    path += uri[at] == '%' ? unescaped(uri.substr(at + 1, 2)) : uri[at];
    if (uri[at] == '%') at += 2;
  }
  return path;
}

}  // namespace drivebench
