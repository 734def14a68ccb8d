#include "clients/command/regression/cases/prepared_case.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/control/control_presets.hpp"
#include "clients/command/regression/cases/check_messages.hpp"
#include "clients/command/regression/cases/reference_run.hpp"
#include "clients/regression/suite/compose.hpp"
#include "clients/regression/suite/place_in_case.hpp"

namespace drivebench::command {
namespace fs = std::filesystem;
using regression::Case;
using regression::DeviceUnderTest;
using regression::RunFacts;

namespace {

RunFacts facts_of(const v1::BenchDescription& bench) {
  RunFacts facts{.period_s = bench.period_s()};
  for (const v1::AxisDescription& axis : bench.axes())
    facts.axes.push_back(axis.name());
  for (const v1::FaultDescription& fault : bench.faults())
    facts.faults.push_back({.name = fault.name(), .bit = fault.bit()});
  return facts;
}

/// The reason why the preset cannot run on this bench; empty: it can.
std::string misfit(const Case& c, const InprocAxis& axis, const control::Preset& preset,
                   const control::Run& run) {
  const std::vector<control::Gain> gains = gains_of(c.device);
  std::string text;
  const reference::AxisView view = {.bench = axis.bench(), .axis = axis.axis(), .known = axis.known()};
  for (const std::string& each :
       mismatches(view, reference::needs_of(preset, gains), run.timing().sample_rate_hz))
    text += (text.empty() ? "" : "; ") + each;
  return text;
}

/// The last tick of a case whose bench arms after so many commands.
std::uint64_t end_tick_of(const Case& c, double period_s, std::uint32_t arming_commands,
                          const control::Run* run) {
  if (c.duration_s) return static_cast<std::uint64_t>(std::llround(*c.duration_s / period_s));
  if (run == nullptr) return RunFacts{}.end_tick;
  return static_cast<std::uint64_t>(run->planned_samples()) + (arming_commands > 1 ? arming_commands : 0);
}

/// The runner is a client of the bench like the drive, so where the drive needs a token it needs one, too.
void check_token(const Case& c, ProblemList& problems) {
  if (regression::find_child(c.device.place, "tokens_file") == nullptr) return;
  if (std::getenv("DRIVEBENCH_TOKEN") != nullptr) return;
  problems.add(c.file, c.device.line, "dut.tcp.tokens_file",
               "needs DRIVEBENCH_TOKEN in the environment: the runner watches the bench with a token, too");
}

/// What is wrong with the composed bench, at the lines of the case that ask for it.
void report_bench(const Case& c, std::string_view sentences, const fs::path& file, ProblemList& problems) {
  const FileText composed = read_file(file, kMaxConfigBytes);
  const std::string place = file.string() + ":";
  for (std::string_view rest = sentences; !rest.empty();) {
    const std::string_view sentence = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), sentence.size() + 1));
    int composed_line = 0;
    const char* const end = sentence.data() + sentence.size();
    const bool is_placed = sentence.starts_with(place);
    const char* rule = sentence.data() + (is_placed ? place.size() : 0);
    if (is_placed) rule = std::from_chars(rule, end, composed_line).ptr;
    const std::string_view said(rule, static_cast<std::size_t>(end - rule));
    const int line = regression::line_in_case(c, composed.text, composed_line);
    if (composed_line > 0 && line > 0 && said.starts_with(": ")) {
      problems.add(c.file, line, "", std::string(said.substr(2)));
    } else {
      problems.add(c.file, c.line, c.name + ":", about_the_bench(std::string(sentence), file));
    }
  }
}

PreparedCase prepare_one(const Case& c, const fs::path& file, ProblemList& problems) {
  const fs::path bench = bench_file_of(c);
  write_file(file, fmt::format("# {}: {} of {}\n{}", bench.filename().string(), c.name,
                               fs::path(c.file).filename().string(), regression::composed_bench(c, bench)));
  check_messages(c, file, problems);
  check_token(c, problems);
  return prepared_on(c, file, problems);
}

/// A case that is ready, or what is wrong with it.
struct Prepared {
  PreparedCase ready{};
  ProblemList problems{};
  std::exception_ptr failure{};
};

Prepared prepared_or_explained(const Case& c, const fs::path& file) {
  Prepared prepared{.ready = {.what = &c, .bench_file = file}};
  if (!c.skip.empty()) return prepared;
  try {
    prepared.ready = prepare_one(c, file, prepared.problems);
  } catch (const ConfigError& error) {
    for (const ConfigProblem& each : error.problems())
      prepared.problems.add(each.file, each.line, each.key, each.rule);
  } catch (const UsageError& error) {
    report_bench(c, error.what(), file, prepared.problems);
  }
  return prepared;
}

/// Cases that several threads prepare. What is said about them is what one thread would say: they are taken
/// in their order until more problems are found than are told, and each one that is taken is looked at.
class Preparation {
 public:
  Preparation(const std::vector<Case>& cases, const fs::path& folder)
      : cases_(cases), folder_(folder), prepared_(cases.size()) {}

  /// Of each thread.
  void work() {
    while (!enough_) {
      const std::size_t n = next_++;
      if (n >= cases_.size()) return;
      try {
        prepared_[n] = prepared_or_explained(cases_[n], folder_ / fmt::format("{}.toml", n));
      } catch (...) {
        prepared_[n].failure = std::current_exception();
      }
      found_ += prepared_[n].problems.count();
      if (prepared_[n].failure != nullptr || found_ >= ProblemList::kMost) enough_ = true;
    }
  }

  /// Of one thread, when all have ended.
  std::vector<PreparedCase> take() {
    ProblemList problems;
    std::vector<PreparedCase> ready;
    ready.reserve(prepared_.size());
    for (Prepared& each : prepared_) {
      if (each.failure != nullptr) std::rethrow_exception(each.failure);
      ready.push_back(std::move(each.ready));
      problems.add(each.problems);
      if (problems.full()) break;
    }
    problems.throw_if_any();
    return ready;
  }

 private:
  const std::vector<Case>& cases_;
  fs::path folder_;
  std::vector<Prepared> prepared_;
  std::atomic<std::size_t> next_ = 0;
  std::atomic<std::size_t> found_ = 0;
  std::atomic<bool> enough_ = false;
};

}  // namespace

std::string misfit(const Case& c, const fs::path& bench) {
  const InprocAxis axis(bench.string(), c.device.axis);
  const control::Preset& preset = chosen_preset(c.device.preset);
  return misfit(c, axis, preset, made(preset, gains_of(c.device)));
}

fs::path bench_file_of(const Case& c) {
  std::error_code ignored;
  const fs::path beside = fs::path(c.file).parent_path() / c.bench;
  return fs::is_regular_file(beside, ignored) ? beside : find_config(c.bench);
}

std::vector<control::Gain> gains_of(const DeviceUnderTest& device) {
  std::vector<control::Gain> gains;
  for (const auto& [name, value] : device.gains)
    gains.push_back({name, value});
  return gains;
}

PreparedCase prepared_on(const Case& c, const fs::path& bench, ProblemList& problems) {
  const InprocAxis axis(bench.string(), c.device.axis);
  PreparedCase prepared{.what = &c, .bench_file = bench, .facts = facts_of(axis.bench())};
  std::optional<control::Run> run;
  if (c.device.kind == DeviceUnderTest::Kind::kPreset) {
    const control::Preset& preset = chosen_preset(c.device.preset);
    run.emplace(made(preset, gains_of(c.device)));
    if (const std::string why = misfit(c, axis, preset, *run); !why.empty()) {
      problems.add(c.file, c.device.line, "dut.preset",
                   fmt::format("is \"{}\", which does not fit the bench: {}", c.device.preset, why));
    }
  }
  prepared.facts.end_tick =
      end_tick_of(c, axis.bench().period_s(), axis.bench().arming_commands(), run ? &*run : nullptr);
  regression::check_on_bench(c, prepared.facts, problems);
  check_references(prepared, problems);
  return prepared;
}

std::string in_lockstep(const fs::path& composed, DeviceUnderTest::Link link) {
  Case c{.name = "", .file = composed.string(), .bench = ""};
  c.device.link = link;
  return regression::composed_bench(c, composed);
}

std::vector<PreparedCase> prepare(const std::vector<Case>& cases, const fs::path& folder, unsigned jobs) {
  Preparation preparation(cases, folder);
  {
    std::vector<std::jthread> helpers;
    for (std::size_t n = 1; n < std::min<std::size_t>(jobs, cases.size()); ++n)
      helpers.emplace_back([&] { preparation.work(); });
    preparation.work();
  }
  return preparation.take();
}

}  // namespace drivebench::command
