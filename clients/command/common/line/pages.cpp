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

/// The list of --help, by what a user wants.
std::vector<pages::VerbGroup> verb_groups() {
  return {
      {.heading = "The first minute", .verbs = {"demo", "doctor"}},
      {.heading = "Serve a bench", .verbs = {"serve", "describe", "status", "take"}},
      {.heading = "Drive and watch", .verbs = {"control", "watch", "web"}},
      {.heading = "Change it while it runs", .verbs = {"set", "inject", "bump", "clear"}},
      {.heading = "Keep its state", .verbs = {"save", "restore", "reset", "branch"}},
      {.heading = "Recordings and plots", .verbs = {"replay", "export", "plot"}},
      {.heading = "Experiments and identification", .verbs = {"experiment", "identify", "track", "filter"}},
      {.heading = "Regression tests", .verbs = {"test", "rerun"}},
      {.heading = "CAN and Modbus", .verbs = {"can", "can-log", "dbc", "can-table", "modbus-map"}},
      {.heading = "Motors and models", .verbs = {"new", "steady-state", "convert", "fmu"}}};
}

}  // namespace

pages::Program program_of_pages() {
  return {.name = "drivebench",
          .version = release_line(),
          .see_also = {"drivebench-server(8)"},
          .groups = verb_groups(),
          .facts = completion_facts};
}

}  // namespace drivebench::command
