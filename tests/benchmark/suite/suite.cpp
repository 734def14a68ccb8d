#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <future>

#include "clients/command/common/programs/installation.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"
#include "tests/benchmark/suite/suite_run.hpp"

namespace drivebench::speed::suite {
namespace {

constexpr std::size_t kRounds = 5;
constexpr double kLeastSpeed = 100.0;
// Of what the machine gives to two programs side by side: 1.9 times as fast on two whole cores.
constexpr double kLeastOfTwo = 0.95;
constexpr double kMostForChecks = 1.25;
constexpr double kMostOverhead_ms = 5.0;
constexpr double kMostProgramOverhead_ms = 80.0;

constexpr std::string_view kOneCheck = "[[check]]\nkind = \"never\"\ncondition = \"state == 4\"\n";

/// A check of every kind that judges samples, but those that look for something else than a servo at rest.
constexpr std::string_view kAllChecks =
    "[[check]]\nkind = \"bounds\"\nsignal = \"i_a_a\"\nabs = 16.0\n"
    "[[check]]\nkind = \"rms\"\nsignal = \"i_b_a\"\nmax = 16.0\n"
    "[[check]]\nkind = \"ripple\"\nsignal = \"speed_rad_s\"\nmax = 500.0\n"
    "[[check]]\nkind = \"energy\"\nformula = \"u_a_v*i_a_a + u_b_v*i_b_a\"\nmax = 1e6\n"
    "[[check]]\nkind = \"steady_state\"\nsignal = \"speed_rad_s\"\nvalue = 0.0\nmax_error = 50.0\n"
    "[[check]]\nkind = \"settles\"\nsignal = \"angle_rad\"\nvalue = 3.14159\nband = 0.05\nwithin_s = 1.0\n"
    "[[check]]\nkind = \"overshoot\"\nsignal = \"angle_rad\"\nvalue = 3.14159\nmax_percent = 50.0\n"
    "[[check]]\nkind = \"rise_time\"\nsignal = \"angle_rad\"\nvalue = 3.14159\nmax_s = 1.0\n"
    "[[check]]\nkind = \"always\"\ncondition = \"bus_voltage_v >= 0\"\n"
    "[[check]]\nkind = \"never\"\ncondition = \"state == 4\"\n"
    "[[check]]\nkind = \"eventually\"\ncondition = \"speed_rad_s > 1\"\n"
    "[[check]]\nkind = \"reaction\"\nafter = \"speed_rad_s > 1\"\ncondition = \"state == 1\"\nwithin_ticks = "
    "5\n"
    "[[check]]\nkind = \"fault_count\"\nfault = \"over_current\"\nmax = 1000000\n";

/// The servo of the book at 8 kHz: it moves, then holds.
std::string preset_case(double bench_s, int count, std::string_view checks) {
  return fmt::format(
      "bench = \"servo\"\nduration_s = {}\n[dut]\npreset = \"book/8.2.2\"\n[dut.gains]\n\"run.hold_s\" = "
      "{}\n{}"
      "[matrix]\nseed = {{from = 1, to = {}}}\n",
      bench_s, bench_s, checks, count);
}

/// The same controller as a process.
std::string program_case(double bench_s, int count) {
  const auto program = command::server_executable().parent_path() / "drivebench";
  return fmt::format(
      "bench = \"servo\"\nduration_s = {}\n[dut]\ncommand = [\"/bin/sh\", \"-c\", "
      "\"exec '{}' control --gain run.hold_s=1 --link \\\"$DRIVEBENCH_LINK\\\"\"]\n{}[matrix]\nseed = {{from "
      "= 1, to = "
      "{}}}\n",
      bench_s, program.string(), kOneCheck, count);
}

/// A suite in a folder of its own.
class SuiteFile {
 public:
  explicit SuiteFile(const std::string& text) : file_(folder_ / "suite.toml") {
    std::ofstream(file_) << text;
  }
  double wall_s(int jobs) const { return run_suite({file_.string(), "--jobs", std::to_string(jobs)}).wall_s; }
  /// Of two programs at the same time, each with all cases and one job.
  double wall_of_two_s() const {
    const std::int64_t begin = now_ns();
    std::future<double> other = std::async(std::launch::async, [this] { return wall_s(1); });
    wall_s(1);
    other.get();
    return 1e-9 * static_cast<double>(now_ns() - begin);
  }

 private:
  ScratchFolder folder_;
  std::filesystem::path file_;
};

struct Round {
  double one_s, two_s, half_s, two_halves_s, one_check_s, short_s, longer_s, program_short_s,
      program_longer_s;
};

}  // namespace

std::vector<Row> measure() {
  const CpuPair cpu = cpu_pair();
  const double long_s = planned(20.0, 1.0);  // of the bench, so that the start of a case does not count
  const int long_cases = planned(4, 2);      // an even number, for two cores
  const int short_cases = planned(100, 2);
  const int program_cases = planned(10, 1);
  const SuiteFile all_checks(preset_case(long_s, long_cases, kAllChecks));
  const SuiteFile half(preset_case(long_s, long_cases / 2, kAllChecks));
  const SuiteFile one_check(preset_case(long_s, long_cases, kOneCheck));
  const SuiteFile shorter(preset_case(0.1, short_cases, kOneCheck));
  const SuiteFile longer(preset_case(0.2, short_cases, kOneCheck));
  const SuiteFile program_shorter(program_case(0.1, program_cases));
  const SuiteFile program_longer(program_case(0.2, program_cases));
  const std::array cpus{cpu.near, cpu.far};
  const Rounds<Round> rounds = undisturbed_rounds(cpus, kRounds, [&]() -> Round {
    return {.one_s = all_checks.wall_s(1),
            .two_s = all_checks.wall_s(2),
            .half_s = half.wall_s(1),
            .two_halves_s = half.wall_of_two_s(),
            .one_check_s = one_check.wall_s(1),
            .short_s = shorter.wall_s(1),
            .longer_s = longer.wall_s(1),
            .program_short_s = program_shorter.wall_s(1),
            .program_longer_s = program_longer.wall_s(1)};
  });
  const auto figure = [&rounds](auto of) { return median(rounds.results, of); };
  const double two_programs = figure([](const Round& r) { return 2.0 * r.half_s / r.two_halves_s; });
  // Twice the short cases less those that last twice as long: what a case costs beside its ticks.
  const auto overhead_ms = [&](double Round::*shortly, double Round::*for_longer, int count) {
    return figure([=](const Round& r) { return 1e3 * (2.0 * (r.*shortly) - r.*for_longer) / count; });
  };
  return {{.name = "suite, a preset at 8 kHz with 12 checks",
           .unit = "times real time",
           .measured = figure([&](const Round& r) { return long_s * long_cases / r.one_s; }),
           .limit = Limit{Limit::Kind::kAtLeast, kLeastSpeed},
           .disturbance = rounds.disturbance,
           .note = "one job"},
          {.name = "suite, two jobs against one",
           .unit = "times as fast",
           .measured = figure([](const Round& r) { return r.one_s / r.two_s; }),
           .limit = Limit{Limit::Kind::kAtLeast, kLeastOfTwo * std::min(2.0, two_programs)},
           .disturbance = rounds.disturbance,
           .note = fmt::format("two programs side by side: {:.2f}", two_programs)},
          {.name = "suite, 12 checks against one",
           .unit = "s",
           .measured = figure(&Round::one_s),
           .floor = figure(&Round::one_check_s),
           .limit = Limit{Limit::Kind::kRatioAtMost, kMostForChecks},
           .disturbance = rounds.disturbance,
           .note = fmt::format("{:g} s of the bench", long_s * long_cases)},
          {.name = "case in process, beside its ticks",
           .unit = "ms",
           .measured = overhead_ms(&Round::short_s, &Round::longer_s, short_cases),
           .limit = Limit{Limit::Kind::kAtMost, kMostOverhead_ms},
           .disturbance = rounds.disturbance},
          {.name = "case with a program, beside its ticks",
           .unit = "ms",
           .measured = overhead_ms(&Round::program_short_s, &Round::program_longer_s, program_cases),
           .limit = Limit{Limit::Kind::kAtMost, kMostProgramOverhead_ms},
           .disturbance = rounds.disturbance,
           .note = "drivebench control and a server, both started anew"}};
}

}  // namespace drivebench::speed::suite
