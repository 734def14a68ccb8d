#include <fmt/core.h>

#include <array>
#include <filesystem>
#include <fstream>

#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/regression/cases/prepared_case.hpp"
#include "clients/command/regression/stored_results.hpp"
#include "clients/regression/suite/case_file.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/measurements.hpp"
#include "tests/benchmark/suite/suite_run.hpp"

namespace drivebench::speed::merge {
namespace {

constexpr double kMost_s = 20.0;
constexpr double kMostMib = 256.0;
constexpr double kMostPage_mb = 10.0;

constexpr std::string_view kCase =
    "bench = \"servo\"\nduration_s = 0.01\n[dut]\npreset = \"book/8.2.2\"\n"
    "[[check]]\nname = \"current\"\nkind = \"bounds\"\nsignal = \"i_a_a\"\nabs = 6.0\n"
    "[[check]]\nname = \"arrives\"\nkind = \"steady_state\"\nsignal = \"angle_rad\"\nvalue = 3.14\nmax_error "
    "= 0.01\n"
    "[matrix]\nseed = {from = 1, to = ";

/// A result as a run would leave it; of every thousandth case one that failed, with a plot.
regression::CaseResult result_of(const regression::Case& c, int place) {
  const bool has_failed = place % 1000 == 0;
  regression::CaseResult result{.name = c.name, .file = c.file, .line = c.line, .values = c.values};
  result.verdict = has_failed ? regression::Verdict::kFail : regression::Verdict::kPass;
  for (const regression::CheckSpec& check : c.checks) {
    result.findings.push_back({.name = check.name,
                               .kind = std::string(check.kind->name),
                               .signal = std::string(check.signal->name),
                               .axis = "servo",
                               .unit = std::string(check.signal->unit),
                               .passed = !has_failed,
                               .applied = true,
                               .measured = 5.0 + 1e-5 * place,
                               .limit = 6.0,
                               .at_s = 0.005,
                               .to_s = 0.01,
                               .sentence = "at least -5.46 A, min -6 A",
                               .line = check.line});
  }
  result.bench_s = 0.01;
  result.samples = 81;
  result.hash = static_cast<std::uint64_t>(place) * 0x9e37'79b9'7f4a'7c15U;
  if (has_failed) result.plots.assign(2, std::string(6000, 'x'));
  return result;
}

/// Version and build, which the results of a run have in their fingerprints.
std::string version_of_drivebench() {
  command::Process program(
      {(command::server_executable().parent_path() / "drivebench").string(), "--version"});
  return program.read_line(command::Process::in(std::chrono::seconds(10))).value_or("");
}

}  // namespace

std::vector<Row> measure() {
  const ScratchFolder folder;
  const std::filesystem::path suite = folder / "merge.toml";
  const std::filesystem::path page = folder / "merge.html";
  const std::string results = folder / "results";
  const int cases = planned(100'000, 1'000);
  std::ofstream(suite) << kCase << cases << "}\n";
  command::StoredResults stored(version_of_drivebench(), {results});
  int place = 0;
  regression::visit_suite(
      suite, [&](const regression::Case& c) { stored.put(result_of(c, place++), stored.fingerprint_of(c)); });
  const std::array cpus{cpu_pair().near};
  Canary canary;
  canary.look(cpus);
  const SuiteCost cost = run_suite({suite.string(), "--merge", results, "--junit", folder / "merge.xml",
                                    "--json", folder / "merge.json", "--html", page.string()},
                                   1);
  canary.look(cpus);
  return {{.name = fmt::format("merge of {} results", cases),
           .unit = "s",
           .measured = cost.wall_s,
           .limit = Limit{Limit::Kind::kAtMost, kMost_s},
           .disturbance = canary.seen(),
           .note = "JUnit, JSON and page; 100 have failed"},
          {.name = "memory of that merge",
           .unit = "MiB",
           .measured = cost.resident_mib,
           .limit = Limit{Limit::Kind::kAtMost, kMostMib}},
          {.name = "its page",
           .unit = "MB",
           .measured = static_cast<double>(std::filesystem::file_size(page)) * 1e-6,
           .limit = Limit{Limit::Kind::kAtMost, kMostPage_mb}}};
}

}  // namespace drivebench::speed::merge
