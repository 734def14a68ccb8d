#include <pthread.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <span>
#include <thread>
#include <utility>
#include <variant>

#include "plant/parameters/parameters.hpp"
#include "server/engine/axis_mail.hpp"
#include "server/engine/engine.hpp"
#include "server/engine/stepped_engine.hpp"
#include "server/engine/tick_mark.hpp"
#include "server/engine/tick_tap.hpp"
#include "server/host/asio.hpp"
#include "server/pacing/tick_clock.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kRequestCapacity = 256;

/// Whether the ticks stand still for the I/O thread.
enum class Hold { kNone, kWanted, kStanding, kOver /* the last tick has run */ };

class ThreadedEngine final : public Engine {
 public:
  ThreadedEngine(const BenchConfig& config, std::unique_ptr<Recorder> recorder, asio::io_context& io,
                 std::unique_ptr<Pacer> pacer)
      : Engine(config, std::move(recorder)),
        ticks_per_wake_(
            config_.mode == RunMode::kRealtime
                ? 1
                : static_cast<Tick>(std::max(kEventsPerWake / config_.axes.size(), std::size_t{1}))),
        requests_(kRequestCapacity),
        events_(4096 + 64 * config_.axes.size()),
        tap_(recorder_.get(), events_),
        bench_(config_.setup, &tap_),
        parameter_mail_(config_.axes.size()),
        lease_mail_(config_.axes.size()),
        wake_(io, ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        clock_(config_.mode, config_, std::move(pacer)) {
    schedule_events(config_, bench_);
    start_ = bench_.save();
    if (!edges_.empty()) tap_.send_edges_of(bench_);
    read_bench();
    await_wake();
  }

  /// Starts the tick thread.
  void start(std::optional<Tick> max_ticks) {
    max_ticks_ = max_ticks;
    std::atomic<bool> ready{false};
    thread_ = std::thread([this, &ready] { run(ready); });
    while (!ready.load())
      std::this_thread::yield();  // notes_ is written before the run starts
  }

  ~ThreadedEngine() override {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }

  Refused check(std::uint32_t axis, Owner owner, const Command& command) const override {
    const Sample& newest = newest_[axis];
    const CommandRules& rules = config_.setup.axes[axis].rules;
    return command_mail_[axis].judge(command, owner,
                                     {.owner = newest.owner,
                                      .tick = static_cast<Tick>(newest.tick),
                                      .is_latched = (newest.faults & kLatchedFaults) != 0,
                                      .period_ns = config_.setup.period_ns,
                                      .step = largest_step(rules, config_.setup.period_ns),
                                      .connection = connection_of(parameters(axis).machine),
                                      .rules = rules,
                                      .drive = parameters(axis).drive,
                                      .takes_voltages = takes_voltages(axis)});
  }

  Refused command(std::uint32_t axis, Owner owner, const Command& command) override {
    const Refused why = check(axis, owner, command);
    if (why == Refused::kNot) {
      command_mail_[axis].send(owner, command);
      if (!answer_clocks_.empty()) answer_clocks_[axis].command_comes(owner, command, period_of(command));
    } else if (!lacks_lease(why)) {
      request({.tick = 0, .axis = axis, .owner = owner, .action = RefusedCommand{are_bad_values(why)}},
              [](Refused, Tick) {});
    }
    return why;
  }

  void advance() override {}

  void take(std::uint32_t axis, Owner by, const std::string& reason, Answer answer) override {
    const bool is_room_for_both = ends_.empty() && requests_.room() >= 2;
    if (is_room_for_both) return Engine::take(axis, by, reason, std::move(answer));
    refuse_to_take(axis, by, Refused::kBusy, answer);
  }

  bool may_be_acquired(std::uint32_t axis) override {
    return holder_of(axis) == 0 && !takes_voltages(axis) && has_room();
  }

  void submit(const Input& input, Answer answer) override {
    // Here, so that clients without the lease do not fill the queue; changes are checked by their sessions.
    if (input.axis < lease_mail_.size() && !may_be_scheduled(input.action)) {
      const Refused why = check_sender(input, holder_of(input.axis), takes_voltages(input.axis));
      if (why != Refused::kNot) return answer(has_room() ? why : Refused::kBusy, tick());
    }
    const bool ends = ends_lease(input);
    // Lease actions do not overtake the ends of leases that wait.
    const bool has_to_wait = std::holds_alternative<LeaseAction>(input.action) && !ends_.empty();
    if (has_to_wait || (ends && requests_.room() == 0)) {
      if (!ends || waits(input)) return answer(Refused::kBusy, tick());
      ends_.push_back({input, std::move(answer)});
      return;
    }
    // Refused commands, which a controller may send without end, leave half of the queue free.
    if (std::holds_alternative<RefusedCommand>(input.action) && requests_.room() <= kRequestCapacity / 2) {
      return answer(Refused::kBusy, tick());
    }
    push(input, std::move(answer));
  }

  void push(const Input& input, Answer answer) {
    const bool writes = std::holds_alternative<ParameterWrite>(input.action);
    const bool taken = requests_.push(input);
    if (writes) parameter_mail_[input.axis].in_flight += taken ? 1 : 0;
    if (writes && !taken) show_parameters(input.axis);  // without the refused write
    if (!taken) return answer(Refused::kBusy, tick());
    const auto* const lease = std::get_if<LeaseAction>(&input.action);
    const bool passes = lease != nullptr && *lease != LeaseAction::kRenew;
    if (passes) lease_mail_[input.axis].send(*lease == LeaseAction::kAcquire ? input.owner : 0);
    answers_.push_back({.answer = std::move(answer),
                        .written_axis = writes ? std::optional(input.axis) : std::nullopt,
                        .passed_axis = passes ? std::optional(input.axis) : std::nullopt});
  }

  std::vector<std::byte> save() override {
    const TicksHeld held(*this);
    return bench_.save();
  }

  bool restore(std::span<const std::byte> state) override {
    const TicksHeld held(*this);
    drain_events();  // what the ticks so far have answered
    if (!bench_.restore_for_holders(state)) return false;
    clock_.begin_anew();
    read_bench();
    on_set_back();
    on_tick();
    on_newest();
    return true;
  }

  Verdict stop() override {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
    bench_.dismiss_controllers();
    const Verdict verdict{.mode = config_.mode,
                          .ticks = static_cast<std::uint64_t>(bench_.tick()),
                          .late_ticks = bench_.sample(0).late_ticks,
                          .lateness = clock_.lateness(),
                          .state_hash = bench_.state_hash()};
    return recorder_ ? recorder_->finish(verdict) : verdict;
  }

  std::uint64_t state_hash() const override { return 0; }
  SharedOctaveHistogram::View lateness() const override { return clock_.shown_lateness(); }

  // ---- tick thread ----

  /// Runs one tick with its requests, commands and answers.
  void run_tick() noexcept {
    clock_.wait_for_tick();
    first_due_ns_.store(clock_.due_ns() - bench_.tick() * config_.setup.period_ns, std::memory_order_relaxed);
    if (const auto base = clock_.new_time_base(bench_.tick()); base && recorder_)
      recorder_->on_time_base(*base);
    {
      const TickMark mark;
      watch_.beat();
      take_requests();
      if (watch_.take_abandoned()) abandon();
      clock_.report_lateness(bench_);
      send_parameters();
    }
    if (recorder_ && config_.mode == RunMode::kFree) recorder_->wait_for_room();
    {
      const TickMark mark;
      bench_.step();
    }
    if (bench_.tick() % ticks_per_wake_ == 0) notify();
  }

 private:
  void run(std::atomic<bool>& ready) {
    pthread_setname_np(pthread_self(), "ticks");
    if (config_.mode == RunMode::kRealtime) notes_ = enter_realtime(config_.realtime);
    ready.store(true);
    while (!stop_.load(std::memory_order_relaxed) && (!max_ticks_ || bench_.tick() < *max_ticks_)) {
      run_tick();
      if (hold_.load(std::memory_order_relaxed) == Hold::kWanted) hold_ticks();
    }
    send_parameters();
    hold_.store(Hold::kOver);
    hold_.notify_all();
    while (!events_.push(RunEnded{}) && !stop_.load()) {
      notify();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    notify();
  }

  /// Stands still between two ticks until the I/O thread lets the ticks go on.
  void hold_ticks() noexcept {
    hold_.store(Hold::kStanding);
    hold_.notify_all();
    hold_.wait(Hold::kStanding);
  }

  /// Takes every lease back.
  void abandon() noexcept {
    for (std::uint32_t axis = 0; axis < bench_.axis_count(); ++axis) {
      if (bench_.owner(axis) == 0) continue;
      bench_.submit(
          {.tick = bench_.tick(), .axis = axis, .owner = bench_.owner(axis), .action = LeaseAction::kLost});
    }
  }

  void take_requests() noexcept {
    for (std::size_t n = 0; n < kRequestCapacity; ++n) {
      const Input* input = requests_.front();
      if (input == nullptr || events_.room() == 0) break;
      events_.push(RequestOutcome{bench_.submit(*input), bench_.tick()});
      requests_.pop();
    }
    for (std::uint32_t axis = 0; axis < command_mail_.size(); ++axis)
      command_mail_[axis].deliver(bench_, axis);
  }

  /// Comes before the samples of the tick, so that a session finds the parameters that its answer promises.
  void send_parameters() noexcept {
    for (std::size_t i = 0; i < parameter_mail_.size(); ++i) {
      ParameterMail& mail = parameter_mail_[i];
      if (std::exchange(mail.sent, bench_.parameter_changes(i)) == bench_.parameter_changes(i)) continue;
      mail.newest.write(ParameterMail::values_of(bench_.axis(i).parameters()));
    }
  }

  /// Wakes the I/O thread, unless it has been woken already.
  void notify() noexcept {
    if (wake_pending_.exchange(true)) return;
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(wake_.native_handle(), &one, sizeof(one));
  }

  // ---- I/O thread ----

  /// No tick runs while it lives, so that the I/O thread may look at the bench and change it.
  class TicksHeld {
   public:
    explicit TicksHeld(ThreadedEngine& engine) : hold_(engine.hold_) {
      Hold before = Hold::kNone;
      if (!engine.thread_.joinable() || !hold_.compare_exchange_strong(before, Hold::kWanted)) return;
      hold_.wait(Hold::kWanted);
    }
    ~TicksHeld() {
      Hold standing = Hold::kStanding;
      if (hold_.compare_exchange_strong(standing, Hold::kNone)) hold_.notify_all();
    }
    TicksHeld(const TicksHeld&) = delete;
    TicksHeld& operator=(const TicksHeld&) = delete;

   private:
    std::atomic<Hold>& hold_;
  };

  /// Takes over what the tick thread would send, while it does not run.
  void read_bench() {
    command_mail_ = std::deque<CommandMail>(config_.axes.size());
    for (std::size_t i = 0; i < newest_.size(); ++i) {
      newest_[i] = bench_.sample(i);
      ParameterMail& mail = parameter_mail_[i];
      mail.newest.take();
      mail.in_force = ParameterMail::values_of(bench_.axis(i).parameters());
      mail.sent = bench_.parameter_changes(i);
      parameters_[i] = bench_.axis(i).parameters();
    }
    for (std::size_t i = 0; i < edges_.size(); ++i)
      edges_[i] = edges_of(bench_, i);
  }

  /// The period in which the sample is the newest that a command answers: it begins when the tick that makes
  /// the sample is due, and ends when the next tick takes the command.
  AnswerClock::Period period_of(const Command& command) const noexcept {
    if (config_.mode != RunMode::kRealtime) return {};
    const std::int64_t length_ns = config_.setup.period_ns;
    return {.begin_ns = first_due_ns_.load(std::memory_order_relaxed) + (command.answers - 1) * length_ns,
            .length_ns = length_ns};
  }

  bool has_room() noexcept { return ends_.empty() && requests_.room() > 0; }
  /// The holder of the lease once the requests on their way have acted.
  Owner holder_of(std::uint32_t axis) const noexcept { return lease_mail_[axis].holder(newest_[axis].owner); }

  void await_wake() {
    wake_.async_wait(
        asio::posix::stream_descriptor::wait_read, [this](const boost::system::error_code& error) {
          if (error) return;
          std::uint64_t count = 0;
          [[maybe_unused]] const ssize_t got = ::read(wake_.native_handle(), &count, sizeof(count));
          wake_pending_.exchange(
              false);  // not a plain store: it must see all entries pushed before the flag was set
          drain_events();
          await_wake();
        });
  }

  void drain_events() {
    const Tick before = tick();
    for (std::size_t i = 0; i < parameter_mail_.size(); ++i)
      take_parameters(i);
    for (std::size_t n = 0; n < events_.capacity(); ++n) {
      const TickEvent* event = events_.front();
      if (event == nullptr) break;
      std::visit([this](const auto& e) { handle(e); }, *event);
      events_.pop();
    }
    if (tick() != before) on_newest();
    while (!ends_.empty() && requests_.room() > 0) {
      const LeaseEnd end = std::move(ends_.front());
      ends_.pop_front();
      push(end.input, end.answer);
    }
  }

  void handle(const TickedSample& s) {
    newest_[s.axis] = s.sample;
    if (!answer_clocks_.empty()) answer_clocks_[s.axis].sample_leaves(static_cast<Tick>(s.sample.tick));
    if (s.axis + 1 < newest_.size()) return;
    answer_outcomes();
    on_tick();
  }
  // Answers wait for the samples of their tick, so that newest() shows a session the tick of its answer.
  void handle(const RequestOutcome& outcome) { outcomes_.push_back(outcome); }
  void handle(const AxisEdges& e) { edges_[e.axis] = e.edges; }
  void handle(const RunEnded&) {
    answer_outcomes();
    if (on_end) on_end();
  }

  void answer_outcomes() {
    for (; !outcomes_.empty(); outcomes_.pop_front()) {
      const Waiting waiting = std::move(answers_.front());
      answers_.pop_front();
      if (waiting.written_axis) {
        take_parameters(*waiting.written_axis);
        --parameter_mail_[*waiting.written_axis].in_flight;
        show_parameters(*waiting.written_axis);
      }
      if (waiting.passed_axis) lease_mail_[*waiting.passed_axis].answered();
      waiting.answer(outcomes_.front().refused, outcomes_.front().tick);
    }
  }

  void take_parameters(std::size_t axis) {
    const auto values = parameter_mail_[axis].newest.take();
    if (!values) return;
    parameter_mail_[axis].in_force = *values;
    show_parameters(axis);
  }

  /// Publishes the parameters in force, unless they lack a write that is in flight.
  void show_parameters(std::size_t axis) {
    const ParameterMail& mail = parameter_mail_[axis];
    if (mail.in_flight != 0) return;
    AxisParameters& p = parameters_[axis];
    const std::span<const Parameter> rows = axis_parameters(p);
    for (std::size_t row = 0; row < rows.size(); ++row)
      rows[row].set(p, mail.in_force[row]);
  }

  // In free mode a wake-up costs more than several ticks; the queue holds the events in between.
  static constexpr std::size_t kEventsPerWake = 1024;

  struct Waiting {
    Answer answer;
    std::optional<std::uint32_t> written_axis;  // of a parameter
    std::optional<std::uint32_t> passed_axis;   // whose lease the request passes on
  };

  /// The end of a lease that found the queue full; its sender does not try again, so it waits here.
  struct LeaseEnd {
    Input input;
    Answer answer;
  };
  bool waits(const Input& end) const noexcept {
    return std::ranges::any_of(ends_, [&end](const LeaseEnd& each) {
      return each.input.axis == end.axis && each.input.owner == end.owner;
    });
  }

  std::optional<Tick> max_ticks_;
  Tick ticks_per_wake_;
  SpscQueue<Input> requests_;
  SpscQueue<TickEvent> events_;
  TickTap tap_;
  Bench bench_;
  std::deque<CommandMail> command_mail_;
  std::deque<ParameterMail> parameter_mail_;
  std::vector<LeaseMail> lease_mail_;
  asio::posix::stream_descriptor wake_;
  std::atomic<bool> wake_pending_{false};
  std::deque<LeaseEnd> ends_;            // at most one for each axis and owner
  std::deque<Waiting> answers_;          // of the requests in flight, in order
  std::deque<RequestOutcome> outcomes_;  // results that wait for the samples of their tick
  TickClock clock_;
  /// When tick 0 was due, or would have been since the clock began anew.
  std::atomic<std::int64_t> first_due_ns_{0};
  std::atomic<bool> stop_{false};
  std::atomic<Hold> hold_{Hold::kNone};
  std::thread thread_;
};

}  // namespace

std::unique_ptr<Engine> make_threaded_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                             asio::io_context& io, std::optional<Tick> max_ticks) {
  std::unique_ptr<Pacer> pacer = config.mode == RunMode::kRealtime
                                     ? make_realtime_pacer(config.realtime.pacer, config.setup.period_ns)
                                     : make_free_pacer();
  auto engine = std::make_unique<ThreadedEngine>(config, std::move(recorder), io, std::move(pacer));
  engine->start(max_ticks);
  return engine;
}

SteppedEngine make_stepped_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                  asio::io_context& io, std::unique_ptr<Pacer> pacer) {
  auto engine = std::make_unique<ThreadedEngine>(config, std::move(recorder), io, std::move(pacer));
  ThreadedEngine* const stepped = engine.get();
  return {.engine = std::move(engine), .tick = [stepped] { stepped->run_tick(); }};
}

}  // namespace drivebench
