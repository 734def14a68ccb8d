#include "clients/command/web/child_verb.hpp"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>

#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;

constexpr auto kLookAround = 100ms;
constexpr auto kPause = 20ms;    // where the output has ended before its program
constexpr auto kTimeToEnd = 5s;  // after SIGTERM
constexpr std::uintmax_t kMostComplaints = 1 << 20;
constexpr std::streamoff kEndOfComplaints = 4096;

std::uintmax_t size_of(const std::filesystem::path& file) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  return error ? 0 : size;
}

/// Ready for a page, without the name of the program; empty: there is no line.
std::string last_line_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const auto size = static_cast<std::streamoff>(size_of(path));
  file.seekg(std::max<std::streamoff>(size - kEndOfComplaints, 0));
  std::string last;
  for (std::string line; std::getline(file, line);)
    if (!line.empty()) last = line;
  constexpr std::string_view kName = "drivebench: ";
  if (last.starts_with(kName)) last.erase(0, kName.size());
  return utf8(last, 500);
}

}  // namespace

web::VerbEnd run_child_verb(const web::Verb& verb, const web::SeeLine& see, const std::stop_token& stop) {
  std::error_code ignored;
  std::filesystem::remove(verb.complaints, ignored);
  std::vector<std::string> arguments = {own_executable().string()};
  arguments.insert(arguments.end(), verb.arguments.begin(), verb.arguments.end());
  Process child(arguments, {.environment = verb.environment,
                            .folder = verb.folder.string(),
                            .error_file = verb.complaints.string(),
                            .input_file = "/dev/null",
                            .own_group = true});
  std::optional<int> code;
  while (!code && !stop.stop_requested() && size_of(verb.complaints) <= kMostComplaints) {
    if (const auto line = child.read_line(Process::in(kLookAround)))
      see(*line);
    else
      code = child.wait(Process::in(kPause));
  }
  if (!code) {
    child.terminate();
    code = child.wait(Process::in(kTimeToEnd));
  }
  while (const auto line = child.read_line(Process::in(0ms)))
    see(*line);
  return {.code = code.value_or(128 + SIGKILL), .complaint = last_line_of(verb.complaints)};
}

}  // namespace drivebench::command
