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

/// The simulator's own account of an axis, with which it compares every sample.
class AxisAccount {
 public:
  using Report = std::function<void(const std::string&)>;

  /// `broken` gets every promise that does not hold.
  AxisAccount(const BenchSetup& setup, std::size_t axis, bool lockstep, Report broken)
      : setup_(setup), axis_(axis), lockstep_(lockstep), broken_(std::move(broken)) {}

  /// Call it after each tick. `late_ticks`: how many ticks have started late so far; `stalled`: the I/O stood
  /// still, which may cost it samples when the ring is full.
  void see(const Sample& s, std::uint64_t late_ticks, bool stalled = false);
  /// Call it after the I/O ran, with the owner that the I/O knows.
  void io_done(Owner owner);
  /// Call it at the end, without any connected client.
  void see_end(const Sample& s);

  // ---- reports of the clients ----

  /// This owner has, or had, the lease, renewed at this tick; `is_there` says whether its session is still
  /// connected, and `forces` is what forces() was when it asked: an answer that was on its way while an
  /// administrator took the axis does not say who came first.
  void granted(Owner owner, Tick tick, std::uint64_t forces, std::function<bool()> is_there);
  /// The owner has asked for its lease to end.
  void may_go(Owner owner);
  /// The owner's session is gone without a release: the axis must be free soon. `asks`: a request for the
  /// lease had no answer yet.
  void gone(Owner owner, bool asks);
  /// No client will speak for this owner again.
  void forget(Owner owner) { leases_.erase(owner); }
  /// An administrator asks for the axis, with any owner, until `force_ends`.
  void force_begins();
  void force_ends() {
    --forces_;
    ++force_changes_;
  }
  /// How often an administrator has begun or ended to take the axis.
  std::uint64_t forces() const noexcept { return force_changes_; }
  /// An administrator has taken the lease by force; in lockstep the sample that shows it is still to come.
  void came_by_force(Owner owner) {
    if (before_.owner != owner) by_force_.insert(owner);
  }
  std::uint64_t tick() const { return before_.tick; }
  void command_sent() { ++commands_; }
  /// An owner sent a command, as the answer to this tick.
  void command_sent(Owner owner, Tick answers);
  /// A client got this sample.
  void told(const v1::Sample& sample, bool in_status) {
    require(history_.agrees(sample, in_status), "a client gets samples as they were");
  }
  /// The owner got a command refused that it had sent at this tick.
  void command_refused(Owner owner, std::uint64_t sent);
  /// A client without the lease got its command refused, which the bench must not count.
  void command_without_lease() { ++without_lease_; }
  /// A client on a transport without reported owners has sent something: it may keep the axis until then, in
  /// times of Scene::awake().
  void may_keep(const std::string& transport, Time until);
  /// The axis is owned over this transport.
  void check_quiet(const std::string& transport, Time awake);
  /// A clear was requested; that owner's was executed at that tick; or its answer will never come.
  void clear_done(Owner owner, Tick tick);
  void clear_unanswered() { ++clears_unknown_; }
  /// A client sent an input for later, which may be refused then.
  void scheduled() { ++scheduled_; }

 private:
  struct Lease {
    Tick renewed = 0;  ///< at this tick or later
    bool may_go = false;
    bool gave_back = false;   ///< at some time
    std::set<Tick> answered;  ///< by its commands, from the one in force on
    std::function<bool()> is_there;
  };

  void require(bool holds, const char* promise);
  void check_numbers(const Sample& s);
  void check_counters(const Sample& s);
  void check_state(const Sample& s);
  void check_owner(const Sample& s);
  bool gave_back(Owner owner) const;

  BenchSetup setup_;
  std::size_t axis_;
  bool lockstep_;
  Report broken_;
  bool seen_ = false;
  Sample before_{};
  std::uint64_t held_since_ = 0;  ///< tick since which the owner is the same, in every sample
  History history_;
  std::uint64_t late_before_ = 0;
  bool late_now_ = false;
  bool skipped_ = false;     ///< the account missed some samples
  std::int64_t silent_ = 0;  ///< ticks in a row without a command
  std::map<Owner, Lease> leases_;
  struct Leaving {
    Owner owner;
    bool asks;           ///< the bench may be about to give it the lease
    bool gave_back;      ///< in samples that the I/O may have yet to see
    Tick seen = -1;      ///< by the I/O, before this tick
    Tick deadline = -1;  ///< -1: the I/O does not know yet that there is a lease to give back
  };
  std::vector<Leaving> leaving_;
  std::vector<Tick> clearings_;  ///< of cleared faults whose request is not known yet
  std::set<Tick> clears_done_;   ///< not yet shown by a sample
  std::set<Owner> by_force_;
  int forces_ = 0;  ///< under way
  std::uint64_t force_changes_ = 0;
  std::map<std::string, Time> kept_until_;  ///< by transport, at the latest
  std::uint64_t commands_ = 0;
  std::uint64_t copies_ = 0;  ///< of commands, perhaps made by the injected fault
  std::uint64_t refusals_told_ = 0;
  std::uint64_t without_lease_ = 0;
  std::uint64_t clears_unknown_ = 0;
  std::uint64_t scheduled_ = 0;
};

}  // namespace drivebench::simulator
