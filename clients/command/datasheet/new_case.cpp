#include "clients/command/datasheet/new_case.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/datasheet/new_file.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;

std::string words_text(const std::string& command) {
  std::istringstream words(command);
  std::vector<std::string> quoted;
  for (std::string word; words >> word;)
    quoted.push_back(in_quotes(word));
  if (quoted.empty()) throw UsageError("--command is empty but must name a program");
  return fmt::format("[{}]", fmt::join(quoted, ", "));
}

/// As the case names its bench: a path from its own folder, or the name of one that came with drivebench.
std::string bench_text(const NewCaseOptions& o) {
  const fs::path found = find_config(o.bench);
  if (!fs::exists(o.bench)) return in_quotes(o.bench);
  const fs::path folder =
      fs::absolute(o.out_file.empty() ? fs::path("x") : fs::path(o.out_file)).parent_path();
  return in_quotes(fs::relative(found, folder).string());
}

std::string case_head(const NewCaseOptions& o) {
  return fmt::format(
      "# A case of a regression suite: `drivebench test` runs it, and this folder with all its cases.\n"
      "bench = {}\n"
      "duration_s = {}   # of the bench's time\n"
      "\n[dut]\n"
      "# Started in the folder of this file, with the address of its bench in DRIVEBENCH_LINK.\n"
      "command = {}\n",
      bench_text(o), real(o.duration_s), words_text(o.command));
}

/// The load comes in the middle, and has a quarter of the time to settle.
std::string load_text(const NewCaseOptions& o, double band_rad_s) {
  return fmt::format(
      "\n[[step]]   # inside the tick, beside the device under test\n"
      "at_s = {}\n"
      "load_nm = {}\n"
      "\n[[check]]\n"
      "name = \"holds its speed under the load\"\n"
      "kind = \"steady_state\"\n"
      "signal = \"speed_rad_s\"\n"
      "value = {}\n"
      "max_error = {}\n"
      "from_s = {}\n",
      real(o.duration_s / 2.0), real(*o.load_nm), real(o.speed_rad_s), real(band_rad_s),
      real(o.duration_s * 0.75));
}

std::string checks_text(const NewCaseOptions& o) {
  const double band_rad_s = o.speed_rad_s == 0.0 ? 1.0 : std::abs(o.speed_rad_s) / 50.0;
  return fmt::format(
             "\n[[check]]\n"
             "name = \"reaches its speed\"\n"
             "kind = \"settles\"\n"
             "signal = \"speed_rad_s\"\n"
             "value = {}\n"
             "band = {}   # to both sides\n"
             "within_s = {}\n"
             "to_s = {}\n",
             real(o.speed_rad_s), real(band_rad_s), real(o.duration_s * 0.4), real(o.duration_s / 2.0)) +
         (o.load_nm ? load_text(o, band_rad_s) : "") +
         "\n[[check]]\n"
         "name = \"keeps below its current limit\"\n"
         "kind = \"fault_count\"\n"
         "fault = \"over_current\"\n"
         "\n# [matrix] makes many cases of this one: values multiply, of any key.\n"
         "# override.axis.0.mechanics.viscous_friction_nms = [0.0, 1e-5]\n";
}

/// The verdict of the program that runs cases.
int check_case(const std::string& file) {
  using namespace std::chrono_literals;
  Process list({own_executable().string(), "test", file, "--list"});
  if (const auto code = list.wait(Process::in(30s)); code != kExitOk)
    throw UsageError(fmt::format("{} is written, but `drivebench test` does not accept it: see above", file));
  fmt::print(stderr, "{0} is written; run it: drivebench test {0}\n", file);
  return kExitOk;
}

}  // namespace

int run_new_case(const NewCaseOptions& options) {
  check_new_file(options.out_file);
  check_text("--command", options.command);
  write_new_file(options.out_file, case_head(options) + checks_text(options));
  return options.out_file.empty() ? kExitOk : check_case(options.out_file);
}

}  // namespace drivebench::command
