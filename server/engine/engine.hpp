#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/bench/bench.hpp"
#include "server/config/config.hpp"
#include "server/engine/owners.hpp"
#include "server/engine/tick_edges.hpp"
#include "server/engine/watch.hpp"
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
  /// Whether an input was carried out, and the tick at whose start.
  using Answer = std::function<void(Refused, Tick)>;

  virtual ~Engine() = default;

  /// Why command() would turn this away now.
  virtual Refused check(std::uint32_t axis, Owner owner, const Command& command) const = 0;
  /// Gives an axis its next command. Only the newest one before a tick counts.
  virtual Refused command(std::uint32_t axis, Owner owner, const Command& command) = 0;
  /// Lockstep: runs the present tick if the commands of all controlled axes are there. Otherwise time goes on
  /// by itself.
  virtual void advance() = 0;
  /// Any other input; the answer comes when the bench has taken or refused it. `from` is the client that
  /// asks, if it is not the client of input.owner.
  void request(const Input& input, Answer answer, const Client* from = nullptr);
  /// Gives the axis to `by`, even if another owner holds it: that owner loses the lease as at the end of its
  /// session, and in the same tick `by` gets it. Calls on_taken.
  virtual void take(std::uint32_t axis, Owner by, const std::string& reason, Answer answer);
  /// Ends the run: safe action, recording closed.
  virtual Verdict stop() = 0;
  /// Hash of the present state; 0 while another thread is changing it.
  virtual std::uint64_t state_hash() const = 0;
  /// Lateness so far; ticks that were late stand in every sample.
  virtual std::int64_t worst_lateness_ns() const = 0;

  /// Called in turn; added before the run, never taken away.
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
  /// Called after on_tick, when there is no newer tick that on_tick has not told of yet.
  Listeners on_newest;
  /// Called once, when a run that has an end has reached it.
  std::function<void()> on_end;
  /// Called with every answer to a request, before the session that asked has it; `from` may be null.
  std::function<void(const Input& input, const Client* from, Refused refused, Tick tick)> on_answered;
  /// Called when take() has taken the lease of an axis from an owner.
  std::vector<std::function<void(const Taken&)>> on_taken;

  /// The owner of the axis, as far as the I/O thread knows; 0: none.
  virtual Owner owner(std::size_t axis) const { return newest_[axis].owner; }

  const Sample& newest(std::size_t axis) const { return newest_[axis]; }
  /// The encoder edges of the tick before newest(), if a bus of the configuration sends them.
  const TickEdges& edges(std::size_t axis) const { return edges_[axis]; }
  Tick tick() const { return static_cast<Tick>(newest_[0].tick); }
  const BenchConfig& config() const { return config_; }
  const Recorder* recorder() const { return recorder_.get(); }
  /// Sentences for people: what the operating system did not grant.
  const std::vector<std::string>& notes() const { return notes_; }

  /// For the supervisor, which watches the ticks from another thread.
  Watch& watch() noexcept { return watch_; }

  /// The parameters in force at newest(), with those writes whose answer is still to come.
  const AxisParameters& parameters(std::size_t axis) const { return parameters_[axis]; }
  /// Why a parameter cannot be written at once. Empty: it can, and counts as written; the caller sends the
  /// input.
  std::string try_parameter(std::size_t axis, std::uint32_t row, double value);
  /// Why the parameter cannot have this value, whatever the values of the others.
  std::string problem_with_value(std::size_t axis, std::uint32_t row, double value) const;
  /// Hash of the configuration, as configuration_hash() has it.
  std::uint64_t configuration_hash() const { return configuration_hash_; }

  /// A number for a new controller.
  Owner new_owner(Client client) { return owners_.add(std::move(client), newest_); }
  /// The client that has this number; null once it is forgotten.
  const Client* client(Owner owner) const { return owners_.find(owner); }

 protected:
  Engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder);

  /// The answer of a take() that does not begin.
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

 private:
  std::uint64_t configuration_hash_;
  Owners owners_;
};

/// Ticks run on the I/O thread, in the call that brings the last command, or as soon after as the recorder
/// has room for one.
std::unique_ptr<Engine> make_lockstep_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                             boost::asio::io_context& io);
/// The same without a recording.
std::unique_ptr<Engine> make_lockstep_engine(const BenchConfig& config);

/// Ticks run on a thread of their own: paced by the clock, or as fast as possible when the mode is free.
/// Stops by itself after max_ticks, if given.
std::unique_ptr<Engine> make_threaded_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                             boost::asio::io_context& io, std::optional<Tick> max_ticks);

/// Gives the bench the events of the configuration, as inputs for later ticks.
void schedule_events(const BenchConfig& config, Bench& bench);

}  // namespace drivebench
