#include "clients/command/regression/cases/check_messages.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/regression/suite/compose.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr auto kPatience = 20s;

/// The line of the file at which each message begins, and its line in the case.
using Places = std::vector<std::pair<int, int>>;

/// A sentence of the server, which begins with file and line, as a problem of the step.
void report(std::string_view sentence, const fs::path& file, const Places& places, const regression::Case& c,
            ProblemList& problems) {
  const std::string place = file.string() + ":";
  int line = 0;
  if (sentence.starts_with(place)) {
    sentence.remove_prefix(place.size());
    const char* const end = sentence.data() + sentence.size();
    const auto [stop, error] = std::from_chars(sentence.data(), end, line);
    if (error == std::errc{}) sentence.remove_prefix(static_cast<std::size_t>(stop - sentence.data()));
    if (sentence.starts_with(": ")) sentence.remove_prefix(2);
  }
  const auto after = std::ranges::upper_bound(places, line, {}, &std::pair<int, int>::first);
  const int at = after == places.begin() ? c.line : std::prev(after)->second;
  problems.add(c.file, at, "step", std::string(sentence));
}

}  // namespace

void check_messages(const regression::Case& c, const fs::path& bench, ProblemList& problems) {
  std::string text;
  Places places;
  for (const auto& message : regression::composed_messages(c, bench)) {
    places.emplace_back(1 + static_cast<int>(std::ranges::count(text, '\n')), message.line);
    text += message.text;
  }
  if (text.empty()) return;
  const fs::path file = fs::path(bench).replace_extension(".messages.toml");
  const fs::path said = fs::path(bench).replace_extension(".messages.txt");
  write_file(file, text);
  Process server(
      {server_executable().string(), bench.string(), "--check-config", "--messages", file.string()},
      {.error_file = said.string(), .joins_output = true});
  if (server.wait(Process::in(kPatience)) == 0) return;
  std::ifstream in(said);
  for (std::string line; std::getline(in, line);)
    report(line, file, places, c, problems);
}

}  // namespace drivebench::command
