#include "clients/command/datasheet/new_file.hpp"

#include <fmt/core.h>

#include <filesystem>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {

void check_new_file(const std::string& path) {
  if (path.empty()) return;
  check_suffix(path, {".toml"});
  if (std::filesystem::exists(path))
    throw UsageError(fmt::format("{} is there already; remove it or choose another name", printable(path)));
}

void write_new_file(const std::string& path, const std::string& text) {
  Output out(path);
  out.write(text);
  out.flush();
}

void check_text(const char* option, const std::string& text) {
  constexpr std::size_t kMostBytes = 200;
  if (!is_plain(text) || text.size() > kMostBytes)
    throw UsageError(fmt::format("{} is '{}' but must be at most {} bytes of plain text", option,
                                 printable(text), kMostBytes));
}

std::string text_of(const FileLine& line) {
  std::string text;
  for (const std::string& comment : line.comment)
    text += fmt::format("# {}\n", comment);
  return text + fmt::format("{} = {}\n", line.key, line.value);
}

}  // namespace drivebench::command
