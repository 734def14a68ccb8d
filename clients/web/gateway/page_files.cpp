#include "clients/web/gateway/page_files.hpp"

#include <array>
#include <fstream>
#include <iterator>
#include <utility>

#include "clients/web/gateway/doors/listen_address.hpp"

namespace drivebench::web {
namespace {

constexpr auto kTypes = std::to_array<std::pair<std::string_view, std::string_view>>({
    {".html", "text/html; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".svg", "image/svg+xml"},
});

std::string_view type_of(const std::filesystem::path& path) {
  for (const auto& [extension, type] : kTypes) {
    if (path.extension() == extension) return type;
  }
  throw StartError("the page has a file of an unknown type: " + path.string());
}

}  // namespace

PageFiles read_page_files(const std::filesystem::path& folder) {
  PageFiles files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::ifstream file(entry.path(), std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    if (!file) throw StartError("cannot read " + entry.path().string());
    const std::string name = entry.path().filename().string();
    files["/" + (name == "index.html" ? "" : name)] = {.bytes = std::move(bytes),
                                                       .type = type_of(entry.path())};
  }
  return files;
}

}  // namespace drivebench::web
