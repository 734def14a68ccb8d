#include "clients/command/common/line/pages.hpp"

#include "clients/command/common/line/version.hpp"
#include "clients/control/presets/presets.hpp"
#include "clients/installation/find_file.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {
namespace {

pages::CompletionFacts completion_facts() {
  std::vector<std::string> presets;
  for (const control::Preset& preset : control::presets())
    presets.emplace_back(preset.name);
  std::vector<std::string> signals;
  signals.reserve(kSignals.size());
  for (const Signal& signal : kSignals)
    signals.emplace_back(signal.name);
  return {.names = {{.kind = "BENCH", .names = installation::file_names("benches"), .or_file = true},
                    {.kind = "MOTOR", .names = installation::file_names("motors"), .or_file = true},
                    {.kind = "EXPERIMENT", .names = installation::file_names("experiments"), .or_file = true},
                    {.kind = "SUITE", .names = installation::folder_names("suites"), .or_file = true},
                    {.kind = "PRESET", .names = std::move(presets)},
                    {.kind = "SIGNAL", .names = std::move(signals)}},
          .other_program = "drivebench-server",
          .other_first_kind = "BENCH"};
}

}  // namespace

pages::Program program_of_pages() {
  return {.name = "drivebench",
          .version = release_line(),
          .see_also = {"drivebench-server(8)"},
          .facts = completion_facts};
}

}  // namespace drivebench::command
