#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tests/benchmark/harness/compare.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed {
namespace {

struct Measurement {
  const char* name;
  const char* what;
  std::vector<Row> (*measure)();
};

constexpr std::array kMeasurements = std::to_array<Measurement>({
    {"tick", "a tick against the bare integration", tick::measure},
    {"machines", "every kind of machine, its sensors, an inverter, a dynamometer", machines::measure},
    {"control", "updates of the reference controllers, closed loops in process", controllers::measure},
    {"free", "free mode with recording", free_mode::measure},
    {"exchange", "lockstep exchanges against a ping-pong", exchange::measure},
    {"shm", "lockstep exchanges through shared memory against a futex", shared_memory::measure},
    {"sdk", "a step behind the C ABI in process against the bench itself", sdk::measure},
    {"bridge", "the gate level: idle runs, steps with an edge, a speed controller", bridge::measure},
    {"experiment", "data of an experiment against a copy of the same bytes", experiment::measure},
    {"identification", "an induction motor, 800 random motors", identifications::measure},
    {"suite", "a regression suite over presets and over a program", suite::measure},
    {"merge", "the reports of 100,000 results of a suite", merge::measure},
    {"realtime", "lateness of the pacers and of the server", realtime::measure},
    {"recorder", "ten axes at 20 kHz into the recorder", recorder::measure},
    {"can", "encoding and decoding of a CAN frame", can_codec::measure},
    {"multicast", "lockstep over udp_multicast against a ping-pong", can_exchange::measure_multicast},
    {"socketcan", "lockstep over the kernel's CAN against a ping-pong", can_exchange::measure_socketcan},
    {"modbus", "lockstep over Modbus against plain libmodbus", modbus_exchange::measure},
    {"abuse", "a polite Modbus client beside three that are not", abuse::measure},
    {"crowd", "a healthy client beside 1,000 idle ones, 32 viewers and 50 that never read", crowd::measure},
    {"attacks", "the ticks beside large frames, a crowd at the door, guesses and forbidden requests",
     attacks::measure},
    {"memory", "memory of the server with 32 viewers", memory::measure},
});

bool is_wanted(const Measurement& measurement, const std::vector<std::string>& only) {
  return only.empty() || std::find(only.begin(), only.end(), measurement.name) != only.end();
}

nlohmann::json read_json(const std::string& path) {
  std::ifstream file(path);
  nlohmann::json json = nlohmann::json::parse(file, nullptr, false);
  if (json.is_discarded()) throw std::runtime_error(path + ": cannot be read, or is not JSON");
  return json;
}

/// Whether something got worse.
bool compare_files(const std::vector<std::string>& files) {
  const std::vector<Compared> rows = compare(read_json(files[0]), read_json(files[1]));
  print_comparison(rows);
  return std::ranges::any_of(rows, [](const Compared& row) { return row.verdict == Change::kSlower; });
}

std::vector<Row> measure(const std::vector<std::string>& only, int times) {
  std::vector<Row> rows;
  for (const Measurement& m : kMeasurements) {
    if (!is_wanted(m, only)) continue;
    fmt::print(stderr, "measuring {}: {}\n", m.name, m.what);
    std::vector<std::vector<Row>> runs;
    const CpuPair cpus = cpu_pair();
    for (int n = 0; n < times; ++n)
      runs.push_back(m.measure());
    if (cpu_pair() != cpus) throw std::logic_error(fmt::format("{} leaves the program pinned", m.name));
    for (Row& row : median_of(std::move(runs)))
      rows.push_back(std::move(row));
  }
  return rows;
}

int run(int argc, char** argv) {
  std::vector<std::string> names;
  std::string list;
  for (const Measurement& m : kMeasurements) {
    names.emplace_back(m.name);
    list += fmt::format("  {:<14} {}\n", m.name, m.what);
  }
  std::vector<std::string> only;
  bool json = false;
  bool markdown = false;
  bool strict = false;
  int times = 1;
  std::vector<std::string> compared;
  CLI::App app("drivebench-benchmark: measures speed and size on this machine, in about ten minutes.");
  app.add_option("--only", only, "these measurements only, separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember(names));
  app.add_option("--soak", plan().soak_minutes, "minutes of the memory measurement")
      ->check(CLI::Range(0.1, 1440.0))
      ->capture_default_str();
  app.add_flag("--json", json, "print one JSON object");
  app.add_flag("--markdown", markdown, "print the table of tests/benchmark/RESULTS.md")->excludes("--json");
  app.add_option("--times", times, "each measurement so often: its median, and its range in the JSON")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_flag("--brief", plan().brief,
               "run everything once, as briefly as it goes; the figures say nothing");
  app.add_option("--compare", compared,
                 "two files of --json, before and after: what got worse; measures nothing")
      ->expected(2)
      ->type_name("FILE FILE");
  app.add_flag("--strict", strict, "exit 1 if a figure is over its limit, or got worse");
  app.footer("Measurements:\n" + list);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  if (!compared.empty()) return compare_files(compared) && strict ? 1 : 0;
  const std::vector<Row> rows = measure(only, times);
  if (json) {
    fmt::print("{}\n", as_json(machine_description(), rows).dump(2));
  } else if (markdown) {
    fmt::print("{}", as_markdown(machine_description(), today(), rows));
  } else {
    print_table(machine_description(), rows);
  }
  const auto is_over = [](const Row& row) { return judgement(row) == Judgement::kOver; };
  return strict && std::any_of(rows.begin(), rows.end(), is_over) ? 1 : 0;
}

}  // namespace
}  // namespace drivebench::speed

int main(int argc, char** argv) {
  try {
    return drivebench::speed::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}
