#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/bench/bench.hpp"
#include "server/bench/change_requests.hpp"
#include "server/config/config.hpp"
#include "server/engine/answer_clock.hpp"
#include "server/engine/owners.hpp"
#include "server/engine/tick_edges.hpp"
#include "server/engine/watch.hpp"
#include "server/host/octave_histogram.hpp"
#include "server/pacing/verdict.hpp"
#include "server/recording/recorder.hpp"

namespace boost::asio {
class io_context;
}

namespace drivebench {

/// One run as the endpoints see it: the bench, its recorder, and the thread that runs the ticks. All methods
/// are called, and all callbacks come, on the I/O thread.
class Engine {
 public:
  /// The result of an input, and the tick at whose start it acted.
  using Answer = std::function<void(Refused, Tick)>;

  virtual ~Engine() = default;

  /// The reason why command() would refuse this command now.
  virtual Refused check(std::uint32_t axis, Owner owner, const Command& command) const = 0;
  /// Gives an axis its next command. Only the newest command before a tick counts.
  virtual Refused command(std::uint32_t axis, Owner owner, const Command& command) = 0;
  /// Lockstep: runs the current tick if the commands of all controlled axes have arrived. The other modes do
  /// nothing here.
  virtual void advance() = 0;
  /// Any other input; the answer comes when the bench has taken or refused it. `from` is the client that
  /// asks, if it is not the client of input.owner.
  void request(const Input& input, Answer answer, const Client* from = nullptr);
  /// Gives the axis to `by`, even if another owner holds it: that owner loses the lease as at the end of its
  /// session, and in the same tick `by` gets it. Calls on_taken.
  virtual void take(std::uint32_t axis, Owner by, const std::string& reason, Answer answer);
  /// The whole state after the last tick: Bench::save(). In real time no tick runs meanwhile.
  virtual std::vector<std::byte> save() = 0;
  /// Goes on from a saved state, with the leases as they are: Bench::restore_for_holders(). Calls
  /// on_set_back, then on_tick and on_newest with the sample of the state. False, and nothing has changed:
  /// the bytes are no state of this bench. Not while objection_to_restore() has one.
  virtual bool restore(std::span<const std::byte> state) = 0;
  /// Goes on from tick 0.
  void reset() { restore(start_); }
  /// Bytes of every state of this bench.
  std::size_t state_size() const { return start_.size(); }
  /// The reason why the bench cannot go to another state; empty: it can.
  std::string_view objection_to_restore() const;
  /// Ends the run: takes the safe action and closes the recording.
  virtual Verdict stop() = 0;
  /// The hash of the current state; 0 while another thread changes it.
  virtual std::uint64_t state_hash() const = 0;
  /// The latenesses of all ticks so far; empty outside real time. Samples hold the number of late ticks.
  virtual SharedOctaveHistogram::View lateness() const { return {}; }

  /// Callbacks in order; added before the run and never removed.
  class Listeners {
   public:
    void add(std::function<void()> listener) { listeners_.push_back(std::move(listener)); }
    void operator()() const {
      for (const auto& listener : listeners_)
        listener();
    }

   private:
    std::vector<std::function<void()>> listeners_;
  };

  /// Called after each tick, when newest() has changed.
  Listeners on_tick;
  /// Called after on_tick, unless a newer tick is already waiting for its on_tick.
  Listeners on_newest;
  /// Called when the bench has gone to another state, before on_tick: its tick may be any.
  Listeners on_set_back;
  /// Called once at the end of a run of fixed length.
  std::function<void()> on_end;
  /// Called with every answer to a request, before the session that asked has it; `from` may be null.
  std::function<void(const Input& input, const Client* from, Refused refused, Tick tick)> on_answered;
  /// Called after take() has taken a lease from a controller.
  std::vector<std::function<void(const Taken&)>> on_taken;

  /// The owner of the axis, as far as the I/O thread knows; 0: none.
  virtual Owner owner(std::size_t axis) const { return newest_[axis].owner; }
  /// The newest sample with the owner, the state and the latched faults of now: in lockstep a controller may
  /// have come, gone or cleared a fault since its tick.
  virtual Sample present(std::size_t axis) const { return newest_[axis]; }
  std::uint64_t latched(std::size_t axis) const { return present(axis).faults & kLatchedFaults; }
  /// Whether a new controller that asks for the lease now would get it.
  virtual bool may_be_acquired(std::uint32_t axis) { return owner(axis) == 0 && !takes_voltages(axis); }
  /// Whether the axis takes the voltages of another one, whose amplifier it shares: it has no commands and no
  /// lease of its own.
  bool takes_voltages(std::size_t axis) const {
    return config_.setup.axes[axis].shares_amplifier_with.has_value();
  }
  /// The reason for people why a request for this axis was refused.
  std::string sentence_of(Refused why, std::size_t axis) const;

  const Sample& newest(std::size_t axis) const { return newest_[axis]; }
  /// The same of every axis.
  std::span<const Sample> newest() const { return newest_; }
  /// The encoder edges of the tick before newest(), if a bus of the configuration sends edges.
  const TickEdges& edges(std::size_t axis) const { return edges_[axis]; }
  Tick tick() const { return static_cast<Tick>(newest_[0].tick); }
  const BenchConfig& config() const { return config_; }
  const Recorder* recorder() const { return recorder_.get(); }
  /// Sentences for people about the rights that the operating system did not grant.
  const std::vector<std::string>& notes() const { return notes_; }

  /// From now on measures when commands come.
  void measure_answers() { answer_clocks_.resize(config_.axes.size()); }
  /// What it measured, by axis; empty if it did not.
  const std::vector<AnswerClock>& answer_clocks() const { return answer_clocks_; }

  /// For the supervisor, which watches the ticks from another thread.
  Watch& watch() noexcept { return watch_; }

  /// The parameters in force at newest(), including writes without an answer yet.
  const AxisParameters& parameters(std::size_t axis) const { return parameters_[axis]; }
  /// The reason why a parameter cannot be written at once. Empty: it can, and counts as written; the caller
  /// sends the input.
  std::string try_parameter(std::size_t axis, std::uint32_t row, double value);
  /// Makes a checked value one of parameters(); the caller sends the input.
  void count_as_written(std::size_t axis, std::uint32_t row, double value);
  /// The axis as a request for a change sees it, with parameters().
  ChangeView change_view(std::size_t axis) const;
  /// The configuration_hash() of the configuration.
  std::uint64_t configuration_hash() const { return configuration_hash_; }

  /// A number for a new controller.
  Owner new_owner(Client client) { return owners_.add(std::move(client), newest_); }
  /// The client that has this number; null once it is forgotten.
  const Client* client(Owner owner) const { return owners_.find(owner); }

 protected:
  Engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder);

  /// Answers a take() that is refused at once.
  void refuse_to_take(std::uint32_t axis, Owner by, Refused why, const Answer& answer);
  /// request() without on_answered.
  virtual void submit(const Input& input, Answer answer) = 0;

  BenchConfig config_;
  Watch watch_;
  std::unique_ptr<Recorder> recorder_;
  std::vector<Sample> newest_;
  std::vector<TickEdges> edges_;  ///< empty: no bus sends them
  std::vector<std::string> notes_;
  std::vector<AxisParameters> parameters_;  ///< parameters(), by axis
  std::vector<std::byte> start_;            ///< the state at tick 0
  std::vector<AnswerClock> answer_clocks_;

 private:
  std::uint64_t configuration_hash_;
  Owners owners_;
};

/// Brings a new bench, which awaits its events, to where the run begins. `recorder` may be null.
using BeginRun = std::function<void(Bench&, Recorder* recorder)>;

/// Runs ticks on the I/O thread, in the call that brings the last command, or later when the recorder has
/// room. After max_ticks, if given, time stands still, and what clients ask for is no input of the run.
/// Without `begin` the run begins at tick 0.
std::unique_ptr<Engine> make_lockstep_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                             boost::asio::io_context& io,
                                             std::optional<Tick> max_ticks = std::nullopt,
                                             const BeginRun& begin = {});
/// Without a recording.
std::unique_ptr<Engine> make_lockstep_engine(const BenchConfig& config);

/// Runs ticks on a thread of its own: paced by the clock, or as fast as possible in free mode. Stops after
/// max_ticks, if given.
std::unique_ptr<Engine> make_threaded_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                             boost::asio::io_context& io, std::optional<Tick> max_ticks);

}  // namespace drivebench
