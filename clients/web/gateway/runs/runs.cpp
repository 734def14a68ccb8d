#include "clients/web/gateway/runs/runs.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "clients/web/gateway/doors/listen_address.hpp"
#include "protocols/json.hpp"
#include "protocols/text.hpp"

namespace drivebench::web {
namespace {

constexpr std::size_t kLongestOwner = 256;
constexpr auto kMotors = std::to_array<std::string_view>({"im", "dc", "pm", "bldc"});
constexpr auto kStateWords =
    std::to_array<std::string_view>({"waits", "runs", "passed", "failed", "cancelled"});

bool is_secret(std::string_view text) {
  return !text.empty() && text.size() <= kLongestOwner && is_plain(text);
}

std::filesystem::path folder_of_results(const std::filesystem::path& reports) {
  std::error_code error;
  std::filesystem::path folder = std::filesystem::canonical(reports, error);
  if (error) throw StartError(fmt::format("--reports {}: {}", reports.string(), error.message()));
  return folder;
}

}  // namespace

Runs::Runs(RunPlaces places, const std::filesystem::path& suites, bool identifies)
    : places_(std::move(places)),
      identifies_(identifies),
      begun_us_(std::chrono::duration_cast<std::chrono::microseconds>(
                    std::chrono::system_clock::now().time_since_epoch())
                    .count()) {
  places_.reports = folder_of_results(places_.reports);
  if (!suites.empty()) suites_.emplace(suites);
  worker_ = std::jthread([this](const std::stop_token& stop) { run_all(stop); });
}

Runs::~Runs() {
  worker_.request_stop();
  const std::lock_guard lock(mutex_);
  for (Run& each : runs_)
    each.stop.request_stop();
}

RunAnswer Runs::ask(std::string_view suite) {
  if (!suites_) throw RunRefusal("this gateway runs no suites: it was started without --suites");
  std::filesystem::path folder = suites_->find(suite);
  if (folder.empty())
    throw RunRefusal(fmt::format("suite: '{}' is no suite of this gateway", printable(suite)));
  return add(fmt::format("suite {}", suite), SuiteWork{.name = std::string(suite), .folder = folder});
}

RunAnswer Runs::ask(IdentificationWork work) {
  if (!identifies_) throw RunRefusal("this gateway identifies no motors: it was started without --identify");
  if (std::ranges::find(kMotors, work.motor) == kMotors.end())
    throw RunRefusal(
        fmt::format("motor: '{}' is not one of {}", printable(work.motor), fmt::join(kMotors, ", ")));
  if (!is_secret(work.owner))
    throw RunRefusal(fmt::format("owner: the secret is not 1 to {} bytes of plain text", kLongestOwner));
  std::string subject = fmt::format("{} of experiment {}", work.motor, work.experiment);
  return add(std::move(subject), std::move(work));
}

RunAnswer Runs::add(std::string subject, Work work) {
  const std::lock_guard lock(mutex_);
  const auto waiting = std::ranges::count(runs_, State::kWaits, &Run::state);
  if (std::cmp_greater_equal(waiting, kMostWaiting))
    throw RunRefusal(fmt::format("{}: {} runs wait already", subject, waiting));
  Run& run = runs_.emplace_back();
  run.number = ++last_number_;
  run.subject = std::move(subject);
  run.work = std::move(work);
  changed_.notify_all();
  return {.number = run.number,
          .sentence = fmt::format("run {}: {} is in the queue", run.number, run.subject)};
}

RunAnswer Runs::cancel(std::uint64_t number) {
  const std::lock_guard lock(mutex_);
  const auto run = std::ranges::find(runs_, number, &Run::number);
  if (run == runs_.end() || (run->state != State::kWaits && run->state != State::kRuns))
    throw RunRefusal(fmt::format("run: {} neither waits nor runs", number));
  run->stop.request_stop();
  RunAnswer answer = {.number = number, .sentence = fmt::format("run {}: {} will end", number, run->subject)};
  if (run->state == State::kWaits) end(*run, State::kCancelled);
  return answer;
}

std::string Runs::list() const {
  nlohmann::ordered_json all = {{"begun_us", begun_us_},
                                {"suites", suites_ ? suites_->names() : std::vector<std::string>()},
                                {"identifies", identifies_},
                                {"runs", nlohmann::ordered_json::array()}};
  const std::lock_guard lock(mutex_);
  for (auto each = runs_.rbegin(); each != runs_.rend(); ++each)
    all["runs"].push_back({{"number", each->number},
                           {"subject", each->subject},
                           {"state", kStateWords[static_cast<std::size_t>(each->state)]},
                           {"done", each->counts.done},
                           {"of", each->counts.of},
                           {"bad", each->counts.bad},
                           {"sentence", each->sentence},
                           {"report", each->report}});
  return json_text(all);
}

Runs::Run* Runs::next_of_those_that_wait() {
  const auto next = std::ranges::find(runs_, State::kWaits, &Run::state);
  return next == runs_.end() ? nullptr : &*next;
}

void Runs::run_all(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  Run* run = nullptr;
  while (changed_.wait(lock, stop, [&] { return (run = next_of_those_that_wait()) != nullptr; })) {
    if (stop.stop_requested()) return;
    run->state = State::kRuns;
    lock.unlock();
    WorkEnd done = carry_out(*run);
    lock.lock();
    run->sentence = std::move(done.sentence);
    run->report = std::move(done.report);
    const bool is_cancelled = run->stop.stop_requested() && run->report.empty();
    end(*run, is_cancelled ? State::kCancelled : done.is_good ? State::kPassed : State::kFailed);
  }
}

/// Nothing else changes the work of a run.
WorkEnd Runs::carry_out(Run& run) {
  const auto see = [this, &run](const CaseCounts& counts) {
    const std::lock_guard lock(mutex_);
    run.counts = counts;
  };
  try {
    if (const auto* const suite = std::get_if<SuiteWork>(&run.work))
      return run_suite(places_, *suite, see, run.stop.get_token());
    return identify(places_, std::get<IdentificationWork>(run.work), run.stop.get_token());
  } catch (const std::exception& error) {
    return {.sentence = error.what()};
  }
}

/// Forgets the one that ended first, where there are too many.
void Runs::end(Run& run, State state) {
  run.state = state;
  run.ended_as = ++last_ended_;
  const auto is_too_old = [this](const Run& each) {
    return each.ended_as > 0 && each.ended_as + kMostKept <= last_ended_;
  };
  std::erase_if(runs_, is_too_old);
}

}  // namespace drivebench::web
