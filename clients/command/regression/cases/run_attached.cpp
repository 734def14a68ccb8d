#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "clients/command/common/session/session.hpp"
#include "clients/command/regression/cases/recorded_server.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using regression::Case;
using regression::CaseResult;
using regression::Judge;
using regression::RunFacts;
using regression::Verdict;

constexpr auto kLookEvery = 2ms;
/// Real time has stopped if the bench needs so much longer than the case.
constexpr auto kMostDelay = 10s;
constexpr std::uint64_t kArmed = 1;
constexpr std::uint64_t kTimedOut = 3;
constexpr std::uint64_t kFault = 4;

Process::Deadline in_seconds(double seconds) {
  return Process::in(std::chrono::milliseconds(std::llround(seconds * 1e3)));
}

/// Waits until the drive has armed, and the case is over. Returns the reason why the run is none; empty: it
/// is one, or the drive has not armed in time.
std::string await_case(BenchView& bench, std::size_t axis, const Case& c, const RunFacts& facts) {
  std::optional<std::uint64_t> armed;
  auto deadline = in_seconds(c.device.time_limit_s);
  for (;;) {
    const Sample sample = bench.newest(axis);
    if (!armed && sample.state == kArmed) {
      armed = sample.tick;
      deadline = in_seconds(*c.duration_s) + kMostDelay;
    }
    if (armed && sample.tick - *armed > facts.end_tick) return {};
    if (interrupted()) return "interrupted";
    if (std::chrono::steady_clock::now() >= deadline) {
      if (!armed) return {};
      return fmt::format("the bench stood at {:.6g} s", static_cast<double>(sample.tick) * facts.period_s);
    }
    std::this_thread::sleep_for(kLookEvery);
  }
}

/// Whether the device is still there, from the samples of its axis in the time of the case. A device that
/// goes after the bench has latched another fault may do so: the checks judge it.
class Presence {
 public:
  explicit Presence(bool loses_commands) : loses_commands_(loses_commands) {}

  void see(const Sample& sample, std::uint64_t tick) noexcept {
    const bool is_gone = sample.owner == 0;
    const bool is_silent = sample.state == kTimedOut && !loses_commands_;
    if (sample.state == kFault || !(is_gone || is_silent)) {
      missing_since_.reset();
    } else if (!missing_since_) {
      missing_since_ = {tick, is_gone ? "left the bench" : "fell silent"};
    }
  }

  /// The reason why the run is none, or empty.
  std::string problem(const RunFacts& facts) const {
    if (!missing_since_) return {};
    const auto at = [&](std::uint64_t tick) { return static_cast<double>(tick) * facts.period_s; };
    return fmt::format("the device under test {} at {:.6g} s of {:.6g} s", missing_since_->second,
                       at(missing_since_->first), at(facts.end_tick));
  }

 private:
  bool loses_commands_;  ///< a step of the case cuts them off
  std::optional<std::pair<std::uint64_t, std::string_view>> missing_since_{};
};

std::string never_armed(bool was_leased, double time_limit_s) {
  return fmt::format("never armed within {:.6g} s: {}", time_limit_s,
                     was_leased ? "the device under test took the lease, but its commands armed nothing"
                                : "no device under test took the lease of the axis");
}

bool cuts_commands_off(const Case& c) {
  return std::ranges::any_of(c.steps, [](const regression::Step& step) {
    return step.action == regression::Step::Action::kFault && step.name == "command_loss";
  });
}

}  // namespace

CaseResult run_attached_case(const PreparedCase& prepared, const fs::path& folder, const RunWishes& wishes,
                             Judge& judge) {
  const Case& c = *prepared.what;
  const std::size_t place = find_axis(prepared.facts, c.device.axis);
  RecordedServer server(prepared, folder, wishes);
  const char* const token = std::getenv("DRIVEBENCH_TOKEN");
  BenchView bench(server.link(), token != nullptr ? token : "");
  const std::string failure = await_case(bench, place, c, prepared.facts);
  const ServerReport report = server.end();
  regression::MissedTicks missed;
  Presence presence(cuts_commands_off(c));
  bool was_leased = false;
  see_recording(recording_in(folder), prepared.facts, [&](const std::vector<Sample>& samples) {
    const Sample& device = samples[place];
    if (judge.is_over(device.tick)) return false;
    judge.see(samples);
    missed.see(device);
    was_leased = was_leased || device.owner != 0;
    if (!judge.begin_tick()) return true;
    presence.see(device, device.tick - *judge.begin_tick());
    return true;
  });
  if (!failure.empty()) return judge.failure(Verdict::kError, failure);
  if (!judge.begin_tick())
    return judge.failure(Verdict::kError, never_armed(was_leased, c.device.time_limit_s));
  CaseResult result = judge.result();
  // A bench that was late may have lost the device itself.
  const std::string problem = presence.problem(prepared.facts);
  if (result.verdict != Verdict::kInvalid && !problem.empty())
    result = judge.failure(Verdict::kError, problem);
  result.output =
      fmt::format("armed at tick {} of the recording, where the case begins\n", *judge.begin_tick());
  add_messages(report.messages, *judge.begin_tick(), prepared.facts.period_s, result);
  if (place >= report.answers.size()) return result;
  const auto timing = std::make_shared<regression::DeviceTiming>(
      regression::DeviceTiming{.way = regression::DeviceTiming::Way::kRealtime,
                               .period_ns = std::llround(prepared.facts.period_s * 1e9),
                               .answers = report.answers[place],
                               .missed = missed});
  if (timing->answers.late != 0 || missed.all != 0)
    timing->effect = {.problem = "an attached device under test cannot be started anew"};
  result.timing = timing;
  return result;
}

}  // namespace drivebench::command
