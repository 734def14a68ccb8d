#include "server/experiments/run.hpp"

#include <chrono>
#include <memory>
#include <string>
#include <utility>

#include "server/engine/engine.hpp"
#include "server/experiments/row_file.hpp"
#include "server/pacing/tick_clock.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/recording.hpp"

namespace drivebench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr Owner kExperimenter = 1;
/// The longest wait of a row before it is published, checked every kLookTicks ticks.
constexpr auto kMaxRowWait = std::chrono::milliseconds(50);
constexpr Tick kLookTicks = 256;

/// The run of an experiment, from its first tick to its verdict.
class ExperimentRun {
 public:
  ExperimentRun(const ExperimentPlan& plan, const RunFiles& files, const std::string& request,
                RunProgress& progress, const std::function<void()>& published)
      : plan_(plan),
        progress_(progress),
        published_(published),
        recording_(files.recording.string()),
        rows_(files.rows, plan.signals, progress.rows),
        recorder_(files.recording, plan.config,
                  {RecordingAttachment{kExperimentAttachment, "application/protobuf", request}},
                  {.reserve_bytes = kDiskReserveBytes, .create = files.create_recording}),
        bench_(plan.config.setup, &recorder_),
        clock_(plan.mode, plan.config,
               plan.mode == RunMode::kRealtime
                   ? make_realtime_pacer(PacerKind::kSleep, plan.config.setup.period_ns)
                   : make_free_pacer()) {}

  RunOutcome run() {
    schedule_events(plan_.config, bench_);
    if (plan_.has_commands()) {
      bench_.submit({.tick = 0, .axis = plan_.axis, .owner = kExperimenter, .action = LeaseAction::kAcquire});
    }
    while (keep_row() && may_go_on()) {
      clock_.wait_for_tick();
      if (const auto base = clock_.new_time_base(bench_.tick())) recorder_.on_time_base(*base);
      submit_events();
      if (plan_.has_commands()) submit_command();
      clock_.report_lateness(bench_);
      recorder_.wait_for_room();
      bench_.step();
    }
    if (!rows_.finish()) fail("the disk takes no more data");
    return finish();
  }

 private:
  const Sample& sample() const { return bench_.sample(plan_.axis); }

  bool keep_row() {
    const Tick tick = bench_.tick();
    if (tick % plan_.decimation == 0 && !rows_.append(sample())) return fail("the disk takes no more data");
    // A free run reads the clock only every kLookTicks; a real-time tick may be long.
    if (plan_.mode == RunMode::kFree && tick % kLookTicks != 0) return true;
    progress_.tick.store(static_cast<std::uint64_t>(tick), std::memory_order_relaxed);
    const Clock::time_point now = Clock::now();
    if (now - last_flush_ < kMaxRowWait) return true;
    last_flush_ = now;
    if (!rows_.flush()) return fail("the disk takes no more data");
    published_();
    return true;
  }

  bool may_go_on() {
    if (recorder_.is_over()) return false;  // finish() reports the reason
    if (is_beyond(plan_.stop, sample())) {
      outcome_.state = v1::EXPERIMENT_STATE_STOPPED;
      outcome_.reason = broken_limit(plan_.stop, sample());
      return false;
    }
    if (bench_.tick() == plan_.ticks) return false;
    if (!progress_.cancel.load(std::memory_order_relaxed)) return true;
    outcome_.state = v1::EXPERIMENT_STATE_CANCELLED;
    outcome_.reason = "cancelled";
    return false;
  }

  bool fail(std::string why) {
    outcome_.state = v1::EXPERIMENT_STATE_FAILED;
    outcome_.reason = std::move(why);
    return false;
  }

  void submit_events() {
    for (; next_event_ < plan_.events.size() && plan_.events[next_event_].tick == bench_.tick();
         ++next_event_) {
      const PlannedEvent& event = plan_.events[next_event_];
      bench_.submit({.tick = event.tick, .axis = event.axis, .owner = 0, .action = event.action});
    }
  }

  void submit_command() {
    PhaseCommand phases = command_of(plan_, sample(), bench_.tick());
    if (bench_.is_latched(plan_.axis)) phases = {};  // accepted while latched, and keeps the lease
    bench_.submit({.tick = bench_.tick(),
                   .axis = plan_.axis,
                   .owner = kExperimenter,
                   .action = Command{.answers = bench_.tick(), .phases = phases}});
  }

  RunOutcome finish() {
    progress_.tick.store(static_cast<std::uint64_t>(bench_.tick()));
    bench_.dismiss_controllers();
    outcome_.verdict = {.mode = plan_.mode,
                        .ticks = static_cast<std::uint64_t>(bench_.tick()),
                        .late_ticks = bench_.sample(0).late_ticks,
                        .lateness = clock_.lateness(),
                        .state_hash = bench_.state_hash()};
    outcome_.verdict = recorder_.finish(outcome_.verdict);
    const std::string problem = problem_of_recording();
    if (!problem.empty() && outcome_.state != v1::EXPERIMENT_STATE_FAILED) fail(problem);
    return std::move(outcome_);
  }

  std::string problem_of_recording() const {
    if (recorder_.lacks_room()) {
      return "the recording ended: its disk is full, or has less than " +
             std::to_string(kDiskReserveBytes >> 20) + " MiB left";
    }
    if (outcome_.verdict.recording != recording_) {
      return "another program removed, moved or changed the recording";
    }
    return outcome_.verdict.gaps > 0 ? "the recording lost entries" : "";
  }

  const ExperimentPlan& plan_;
  RunProgress& progress_;
  const std::function<void()>& published_;
  std::string recording_;
  RowWriter rows_;
  Recorder recorder_;
  Bench bench_;
  TickClock clock_;
  std::size_t next_event_ = 0;
  Clock::time_point last_flush_ = Clock::now();
  RunOutcome outcome_;
};

}  // namespace

RunOutcome run_experiment(const ExperimentPlan& plan, const RunFiles& files, const std::string& request,
                          RunProgress& progress, const std::function<void()>& published) {
  return ExperimentRun(plan, files, request, progress, published).run();
}

}  // namespace drivebench
