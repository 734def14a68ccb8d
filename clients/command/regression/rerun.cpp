#include "clients/command/regression/rerun.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/programs/temporary_folder.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/recording/recorded_samples.hpp"
#include "clients/command/regression/bundles/bundle.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "clients/command/regression/cases/server_report.hpp"
#include "clients/command/regression/failures/serve_failure.hpp"
#include "clients/command/regression/test.hpp"
#include "clients/regression/reports/reports.hpp"
#include "clients/regression/suite/compose.hpp"
#include "protocols/json.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using regression::CaseResult;
using regression::RunFacts;

constexpr double kMostTicks = 1e15;

std::string text_of(const Signal& signal, const Sample& sample) {
  switch (signal.type) {
    case SignalType::kUnsigned:
      return fmt::to_string(sample.*signal.as_unsigned);
    case SignalType::kSigned:
      return fmt::to_string(sample.*signal.as_signed);
    case SignalType::kReal:
      break;
  }
  return fmt::to_string(sample.*signal.as_real);
}

bool same_bits(const Signal& signal, const Sample& a, const Sample& b) noexcept {
  switch (signal.type) {
    case SignalType::kUnsigned:
      return a.*signal.as_unsigned == b.*signal.as_unsigned;
    case SignalType::kSigned:
      return a.*signal.as_signed == b.*signal.as_signed;
    case SignalType::kReal:
      break;
  }
  return std::bit_cast<std::uint64_t>(a.*signal.as_real) == std::bit_cast<std::uint64_t>(b.*signal.as_real);
}

/// The samples of a recording up to the end of its case. The server may have gone on for some ticks.
class CaseSamples {
 public:
  CaseSamples(const fs::path& file, const RunFacts& facts)
      : recorded_(file, facts.axes), end_tick_(facts.end_tick) {}

  std::optional<RecordedSamples::Row> next() {
    const auto row = recorded_.next();
    return row && row->sample.tick <= end_tick_ ? row : std::nullopt;
  }

 private:
  RecordedSamples recorded_;
  std::uint64_t end_tick_;
};

/// "1 sample", "2 samples".
std::string count_text(std::uint64_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

/// A sentence on where the two runs first differ.
std::string comparison(const fs::path& before, const fs::path& now, const RunFacts& facts) {
  CaseSamples old_samples(before, facts);
  CaseSamples new_samples(now, facts);
  for (std::uint64_t count = 0;; ++count) {
    end_if_interrupted();
    const auto was = old_samples.next();
    const auto is = new_samples.next();
    if (!was && !is) return fmt::format("the same to the bit: {}", count_text(count, "sample"));
    if (!was || !is) {
      return fmt::format("the {} run ends first, before tick {}; up to there they are the same",
                         was ? "new" : "recorded", was ? was->sample.tick : is->sample.tick);
    }
    for (const Signal& signal : kSignals) {
      if (same_bits(signal, was->sample, is->sample)) continue;
      return fmt::format("differs first at tick {}: {}.{} was {} and is {}", was->sample.tick,
                         facts.axes[was->axis], signal.name, text_of(signal, was->sample),
                         text_of(signal, is->sample));
    }
  }
}

void require_recording(const RerunOptions& options, const Unpacked& bundle) {
  if (fs::exists(bundle.recording)) return;
  throw UsageError(fmt::format("{}: entry \"run.mcap\": is missing: the case ended before its bench began",
                               options.bundle));
}

/// The tick in `--from`: a whole number, or a time with its unit.
std::uint64_t tick_of(const std::string& from, double period_s) {
  const bool is_time = from.ends_with('s');
  const std::string_view digits(from.data(), from.size() - (is_time ? 1 : 0));
  double number = -1.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  const double tick = is_time ? std::round(number / period_s) : number;
  const bool is_whole = tick >= 0.0 && tick <= kMostTicks && tick == std::floor(tick);
  if (error != std::errc{} || end != digits.data() + digits.size() || !is_whole) {
    throw UsageError(fmt::format(
        "--from: is \"{}\" but must be a tick, as 304, or a time of the bench, as 0.038s", printable(from)));
  }
  return static_cast<std::uint64_t>(tick);
}

/// The part of the recorded run that is repeated; nothing: the run begins with the device under test.
std::optional<RepeatedPart> repeated_part(const RerunOptions& options, const Unpacked& bundle,
                                          const PreparedCase& prepared) {
  if (options.from.empty() && !options.interactive) return std::nullopt;
  require_recording(options, bundle);
  const JudgedRecording run = judged_recording(prepared, bundle.recording);
  if (options.from.empty()) return RepeatedPart{bundle.recording, run.failure_tick};
  const RepeatedPart part{bundle.recording, tick_of(options.from, prepared.facts.period_s)};
  if (part.until > run.last_tick) {
    throw UsageError(
        fmt::format("--from: is tick {}, but the recorded run ends at tick {}", part.until, run.last_tick));
  }
  return part;
}

/// Replays the commands of the recording on a bench, without the device under test.
int replay_plant(const RerunOptions& options, const Unpacked& bundle) {
  require_recording(options, bundle);
  Process server({server_executable().string(), "--replay", bundle.recording.string(), "--json"});
  const auto line = await_answer(server, kRepetitionPatience,
                                 [](std::string_view text) { return std::optional(std::string(text)); });
  if (!line) throw std::runtime_error("drivebench-server ended without a report");
  const auto report = parse_json(*line);
  const auto problem = report.at("problem").get<std::string>();
  if (!report.at("usable").get<bool>())
    throw UsageError(fmt::format("{}: entry \"run.mcap\": {}", options.bundle, problem));
  if (!report.at("equal").get<bool>()) {
    fmt::print("the plant differs: {}\n", problem);
    return kExitFailed;
  }
  fmt::print("the plant is the same to the bit: {}, {}\n",
             count_text(report.at("samples").get<std::uint64_t>(), "sample"),
             count_text(report.at("inputs").get<std::uint64_t>(), "input"));
  return kExitOk;
}

PreparedCase prepared_or_refused(const RerunOptions& options, const Unpacked& bundle) {
  ProblemList problems;
  try {
    PreparedCase prepared = prepared_on(bundle.what, bundle.bench_file, problems);
    problems.throw_if_any();
    return prepared;
  } catch (const ConfigError& error) {
    throw UsageError(fmt::format("{}: {}", options.bundle, error.what()));
  }
}

bool is_program(const PreparedCase& prepared) {
  return prepared.what->device.kind == regression::DeviceUnderTest::Kind::kProgram;
}

bool has_messages(const regression::Case& c) {
  using regression::Step;
  return std::ranges::any_of(c.steps, [](const Step& step) { return step.action == Step::Action::kMessage; });
}

/// A sentence on a program that was started in the middle of the recorded run.
std::string beginning(const RepeatedPart& part, double period_s) {
  return fmt::format(
      "the run up to tick {} ({:.6g} s) is the recorded one, to the bit; the device under test was started "
      "there, so that later samples are not compared",
      part.until, static_cast<double>(part.until) * period_s);
}

int run_again(const RerunOptions& options, const Unpacked& bundle, const PreparedCase& prepared,
              const fs::path& folder) {
  const std::optional<RepeatedPart> part = repeated_part(options, bundle, prepared);
  if (part && prepared.what->is_realtime) {
    throw UsageError(
        "--from: the case runs in real time, where the bench waits for no device; --interactive serves it in "
        "lockstep");
  }
  if (part && has_messages(*prepared.what)) {
    throw UsageError(
        "--from: the case has messages to its device under test: one that begins in the middle would lack "
        "those of before");
  }
  const CaseResult result = run_case(prepared, folder, {.repeats = part});
  fmt::print("{}", regression::table_row(result));
  record_case(prepared, folder, part);
  if (bundle.program != options.program)
    fmt::print("the bundle is of {}, this is {}\n", bundle.program, options.program);
  if (prepared.what->device.kind == regression::DeviceUnderTest::Kind::kAttached) {
    fmt::print("the device under test was not started anew: no samples are compared\n");
  } else if (part && is_program(prepared)) {
    if (fs::exists(recording_in(folder))) fmt::print("{}\n", beginning(*part, prepared.facts.period_s));
  } else if (fs::exists(bundle.recording) && fs::exists(recording_in(folder))) {
    fmt::print("{}\n", comparison(bundle.recording, recording_in(folder), prepared.facts));
  }
  regression::Totals totals;
  totals.add(result);
  return exit_code_of(totals);
}

}  // namespace

int run_rerun(const RerunOptions& options) {
  catch_interrupts();
  const TemporaryFolder folder;
  const fs::path parts = folder.path() / "bundle";
  const fs::path run = folder.path() / "run";
  fs::create_directory(parts);
  fs::create_directory(run);
  const Unpacked bundle = unpack_bundle(options.bundle, parts);
  end_if_interrupted();
  if (options.plant_only) return replay_plant(options, bundle);
  // The bus of the case is for its device under test alone.
  if (!options.interactive)
    write_file(bundle.bench_file, regression::linked_bench(bundle.what, bundle.bench_file));
  const PreparedCase prepared = prepared_or_refused(options, bundle);
  if (!options.interactive) return run_again(options, bundle, prepared, run);
  return serve_bench(prepared, *repeated_part(options, bundle, prepared), options.port);
}

}  // namespace drivebench::command
