#include <chrono>
#include <optional>
#include <utility>

#include "server/engine/engine.hpp"
#include "server/engine/tick_mark.hpp"
#include "server/host/asio.hpp"

namespace drivebench {
namespace {

class LockstepEngine final : public Engine {
 public:
  LockstepEngine(const BenchConfig& config, std::unique_ptr<Recorder> recorder, asio::io_context* io,
                 std::optional<Tick> max_ticks, const BeginRun& begin)
      : Engine(config, std::move(recorder)),
        max_ticks_(max_ticks),
        bench_(config_.setup, recorder_.get()),
        shown_changes_(config_.axes.size()) {
    if (io != nullptr) disk_timer_.emplace(*io);
    if (begin) {
      start_ = state_at_start();
      await_events(config_, bench_);
      begin(bench_, recorder_.get());
    } else {
      schedule_events(config_, bench_);
      start_ = bench_.save();
    }
    show();
    // The newest samples are from before the end of the leases with which a repetition ends.
    for (std::size_t i = 0; i < newest_.size(); ++i)
      newest_[i].owner = bench_.owner(i);
  }

  /// While time waits for the disk each axis accepts one command and no newer ones, which would be recorded
  /// without end.
  Refused check(std::uint32_t axis, Owner owner, const Command& command) const override {
    const Refused why = judge(command, owner, bench_.command_view(axis));
    return why == Refused::kNot && waits_for_disk_ && bench_.has_command(axis) ? Refused::kBusy : why;
  }

  Refused command(std::uint32_t axis, Owner owner, const Command& command) override {
    const Refused why = has_room() ? Refused::kNot : check(axis, owner, command);
    if (why != Refused::kNot) return why;  // not counted: that would be an input
    if (is_over()) return check(axis, owner, command);
    const Refused refused =
        bench_.submit({.tick = bench_.tick(), .axis = axis, .owner = owner, .action = command});
    if (refused == Refused::kNot && axis < answer_clocks_.size())
      answer_clocks_[axis].command_comes(owner, command, {});
    return refused;
  }

  void take(std::uint32_t axis, Owner by, const std::string& reason, Answer answer) override {
    if (!has_room() || is_over()) return refuse_to_take(axis, by, Refused::kBusy, answer);
    is_taking_ = true;  // no tick between the two inputs
    Engine::take(axis, by, reason, std::move(answer));
    is_taking_ = false;
    advance();
  }

  void advance() override {
    if (is_taking_ || is_over()) return;
    if (recorder_ && !recorder_->has_room()) return try_again_soon();
    bool commanded = false;
    for (std::size_t i = 0; i < bench_.axis_count(); ++i) {
      if (bench_.owner(i) != 0 && !bench_.has_command(i) && !bench_.is_latched(i)) return;
      commanded = commanded || bench_.has_command(i);
    }
    if (!commanded) return;  // without a controller time stands still
    watch_.beat();
    {
      const TickMark mark;
      bench_.step();
    }
    show();
    for (AnswerClock& clock : answer_clocks_)
      clock.sample_leaves(bench_.tick());
    on_tick();
    on_newest();
  }

  std::vector<std::byte> save() override { return bench_.save(); }

  bool restore(std::span<const std::byte> state) override {
    if (!bench_.restore_for_holders(state)) return false;
    show();
    on_set_back();
    on_tick();
    on_newest();
    return true;
  }

  void submit(const Input& input, Answer answer) override {
    // A controller may leave, as it would at any time; stop() dismisses it.
    if (is_over()) return answer(ends_lease(input) ? Refused::kNot : Refused::kBusy, bench_.tick());
    const bool may_be_recorded = has_room() || is_taking_ || ends_own_lease(input);
    const Refused refused = may_be_recorded ? bench_.submit(input) : Refused::kBusy;
    if (std::holds_alternative<ParameterWrite>(input.action) && input.axis < parameters_.size()) {
      parameters_[input.axis] = bench_.axis(input.axis).parameters();  // even if it was refused
    }
    answer(refused, bench_.tick());
    advance();  // the controller that the tick waited for may have left
  }

  Verdict stop() override {
    bench_.dismiss_controllers();
    const Verdict verdict{.mode = RunMode::kLockstep,
                          .ticks = static_cast<std::uint64_t>(bench_.tick()),
                          .state_hash = bench_.state_hash()};
    return recorder_ ? recorder_->finish(verdict) : verdict;
  }

  Owner owner(std::size_t axis) const override { return bench_.owner(axis); }
  Sample present(std::size_t axis) const override {
    Sample now = newest_[axis];
    now.owner = bench_.owner(axis);
    now.state = static_cast<std::uint64_t>(bench_.state(axis));
    now.faults = (now.faults & ~kLatchedFaults) | bench_.latched(axis);
    return now;
  }
  bool may_be_acquired(std::uint32_t axis) override {
    return Engine::may_be_acquired(axis) && has_room() && !is_over();
  }
  std::uint64_t state_hash() const override { return bench_.state_hash(); }

 private:
  std::vector<std::byte> state_at_start() const {
    Bench bench(config_.setup);
    schedule_events(config_, bench);
    return bench.save();
  }

  /// Whether inputs that may come without end may be recorded. The commands of a tick and the end of a lease
  /// always may.
  bool has_room() const noexcept { return !recorder_ || (!waits_for_disk_ && recorder_->has_room()); }

  bool is_over() const noexcept { return max_ticks_ && bench_.tick() >= *max_ticks_; }

  bool ends_own_lease(const Input& input) const noexcept {
    return ends_lease(input) && input.owner != 0 && input.axis < bench_.axis_count() &&
           bench_.owner(input.axis) == input.owner;
  }

  /// The disk is slow: no tick runs until it has caught up, and sessions are served meanwhile.
  void try_again_soon() {
    if (std::exchange(waits_for_disk_, true)) return;
    disk_timer_->expires_after(std::chrono::milliseconds(1));
    disk_timer_->async_wait([this](const boost::system::error_code& error) {
      if (error) return;
      waits_for_disk_ = false;
      advance();
    });
  }

  void show() {
    for (std::size_t i = 0; i < edges_.size(); ++i)
      edges_[i] = edges_of(bench_, i);
    for (std::size_t i = 0; i < newest_.size(); ++i) {
      newest_[i] = bench_.sample(i);
      if (std::exchange(shown_changes_[i], bench_.parameter_changes(i)) != bench_.parameter_changes(i)) {
        parameters_[i] = bench_.axis(i).parameters();
      }
    }
  }

  std::optional<Tick> max_ticks_;
  Bench bench_;
  std::vector<std::uint64_t> shown_changes_;
  bool is_taking_ = false;
  std::optional<ServerTimer> disk_timer_;  // only with a recorder
  bool waits_for_disk_ = false;
};

}  // namespace

std::unique_ptr<Engine> make_lockstep_engine(const BenchConfig& config) {
  return std::make_unique<LockstepEngine>(config, nullptr, nullptr, std::nullopt, BeginRun());
}

std::unique_ptr<Engine> make_lockstep_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                             asio::io_context& io, std::optional<Tick> max_ticks,
                                             const BeginRun& begin) {
  return std::make_unique<LockstepEngine>(config, std::move(recorder), &io, max_ticks, begin);
}

}  // namespace drivebench
