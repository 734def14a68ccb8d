#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "server/bench/bench.hpp"
#include "tests/adversity/simulator/account/history.hpp"
#include "tests/adversity/simulator/world/schedule.hpp"

namespace drivebench::simulator {

/// What the simulator knows of an axis by itself, against which every sample is held.
class AxisAccount {
 public:
  using Report = std::function<void(const std::string&)>;

  /// `broken` is told of every promise that does not hold.
  AxisAccount(const BenchSetup& setup, std::size_t axis, bool lockstep, Report broken)
      : setup_(setup), axis_(axis), lockstep_(lockstep), broken_(std::move(broken)) {}

  /// After each tick. `late_ticks`: so many started late until now; `stalled`: the I/O stood still, which may
  /// cost it samples when the ring is full.
  void see(const Sample& s, std::uint64_t late_ticks, bool stalled = false);
  /// After the I/O had its turn, with the owner that it knows.
  void io_done(Owner owner);
  /// When everything has settled and nobody is connected any more.
  void see_end(const Sample& s);

  // ---- told by clients ----

  /// This owner has, or had, the lease, which was renewed at this tick; `is_there` says whether it could
  /// still speak.
  void granted(Owner owner, Tick tick, std::function<bool()> is_there);
  /// It has asked for its lease to end.
  void may_go(Owner owner);
  /// It is gone without a word: the axis must be free soon. `asks`: with a request for the lease that has no
  /// answer yet.
  void gone(Owner owner, bool asks);
  /// Nobody will hear of this owner again.
  void forget(Owner owner) { leases_.erase(owner); }
  /// An administrator asks for the axis, whoever has it, until `force_ends`.
  void force_begins();
  void force_ends() { --forces_; }
  /// It has the lease, which it has taken by force; in lockstep the sample that shows it is still to come.
  void came_by_force(Owner owner) {
    if (before_.owner != owner) by_force_.insert(owner);
  }
  void command_sent() { ++commands_; }
  /// By an owner, as the answer to this tick.
  void command_sent(Owner owner, Tick answers);
  /// It was sent this sample.
  void told(const v1::Sample& sample, bool in_status) {
    require(history_.agrees(sample, in_status), "who is told of a sample is told what it says");
  }
  void command_refused() { ++refusals_told_; }
  /// Somebody on a transport that tells of no owners has spoken: he may keep the axis until then, in times of
  /// Scene::awake().
  void may_keep(const std::string& transport, Time until);
  /// The axis is owned by somebody on this transport.
  void check_quiet(const std::string& transport, Time awake);
  /// A request to clear was sent; carried out by that owner at that tick; or will never have an answer.
  void clear_done(Owner owner, Tick tick);
  void clear_unanswered() { ++clears_unknown_; }
  /// An input for later, which may be refused then.
  void scheduled() { ++scheduled_; }

 private:
  struct Lease {
    Tick renewed = 0;  ///< at this tick or later
    bool may_go = false;
    bool gave_back = false;   ///< at some time
    std::set<Tick> answered;  ///< by its commands, from that in force on
    std::function<bool()> is_there;
  };

  void require(bool holds, const char* promise);
  void check_numbers(const Sample& s);
  void check_counters(const Sample& s);
  void check_state(const Sample& s);
  void check_owner(const Sample& s);

  BenchSetup setup_;
  std::size_t axis_;
  bool lockstep_;
  Report broken_;
  bool seen_ = false;
  Sample before_{};
  History history_;
  std::uint64_t late_before_ = 0;
  bool late_now_ = false;
  bool skipped_ = false;     ///< some samples were never seen
  std::int64_t silent_ = 0;  ///< ticks in a row without a command
  std::map<Owner, Lease> leases_;
  struct Leaving {
    Owner owner;
    bool asks;           ///< the bench may only be giving it the lease
    Tick seen = -1;      ///< by the I/O, before this tick
    Tick deadline = -1;  ///< -1: the I/O does not know yet that there is a lease to give back
  };
  std::vector<Leaving> leaving_;
  std::vector<Tick> clearings_;  ///< when latched faults were cleared, not yet known to be asked for
  std::set<Tick> clears_done_;   ///< of which no sample tells yet
  std::set<Owner> by_force_;
  int forces_ = 0;                          ///< under way
  std::map<std::string, Time> kept_until_;  ///< by transport, at the latest
  std::uint64_t commands_ = 0;
  std::uint64_t copies_ = 0;  ///< of commands, that the injected fault may have made
  std::uint64_t refusals_told_ = 0;
  std::uint64_t clears_unknown_ = 0;
  std::uint64_t scheduled_ = 0;
};

}  // namespace drivebench::simulator
