#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "plant/parameters/parameters.hpp"
#include "server/bench/bench.hpp"
#include "server/engine/mailbox.hpp"

/// The newest values that the I/O thread and the tick thread exchange about an axis.
namespace drivebench {

/// Passes commands to the tick thread and the bench's decisions back.
class CommandMail {
 public:
  struct Sent {
    Owner owner = 0;
    std::uint64_t number = 0;  ///< of the command, from 1 on; 0: none
    Command command{};
  };
  /// The state of lease and commands in the bench before a tick.
  struct Seen {
    Owner owner = 0;
    std::uint64_t decided = 0;  ///< number of the last command that the bench accepted or refused
    Command newest{};           ///< the last command accepted under this lease
  };

  // ---- I/O thread ----

  /// The reason why a command would be refused. `view` holds the axis from its newest sample, the owner
  /// included: the end of a lease becomes known with the sample that shows it, so that a session learns of
  /// the new owner before its command is refused. The last accepted command comes from here and is never
  /// older.
  Refused judge(const Command& command, Owner sender, CommandView view) const noexcept {
    if (const auto newest = from_bench_.take()) {
      decided_ = newest->decided;
      if (newest->owner != seen_.owner) before_ = seen_;
      seen_ = *newest;
    }
    const Seen& lease = seen_.owner == view.owner ? seen_ : before_;
    view.newest = lease.owner == view.owner ? lease.newest : Command{};
    const Refused why = drivebench::judge(command, sender, view);
    if (why != Refused::kNot || sent_.owner != sender || sent_.number <= decided_) return why;
    // The bench may accept the previous command or see only this one: this one must be valid in both cases.
    view.newest = sent_.command;
    return drivebench::judge(command, sender, view);
  }
  void send(Owner owner, const Command& command) noexcept {
    sent_ = {.owner = owner, .number = sent_.number + 1, .command = command};
    to_bench_.write(sent_);
  }

  // ---- tick thread ----

  /// Gives the bench the newest command, if there is a new one, and sends its state back.
  void deliver(Bench& bench, std::uint32_t axis) noexcept {
    if (const auto newest = to_bench_.take()) {
      bench.submit({.tick = bench.tick(), .axis = axis, .owner = newest->owner, .action = newest->command});
      told_.decided = newest->number;
      is_told_ = false;
    }
    const CommandView view = bench.command_view(axis);
    if (is_told_ && told_.owner == view.owner && told_.newest.answers == view.newest.answers) return;
    told_ = {.owner = view.owner, .decided = told_.decided, .newest = view.newest};
    from_bench_.write(told_);
    is_told_ = true;
  }

 private:
  Mailbox<Sent> to_bench_;
  mutable Mailbox<Seen> from_bench_;   // mutable: reading a mailbox empties it
  Sent sent_;                          // I/O thread: the last command sent
  mutable Seen seen_;                  // I/O thread: the last received state
  mutable Seen before_;                // I/O thread: the last received state of the lease before that one
  mutable std::uint64_t decided_ = 0;  // I/O thread: number of the last command that the bench has decided
  Seen told_;                          // tick thread: the last sent state
  bool is_told_ = false;               // tick thread: no decision since then
};

/// The lease of an axis on the I/O thread, which knows the requests that the bench has yet to take.
class LeaseMail {
 public:
  /// The holder once these requests have acted; `shown` is the holder in the newest sample.
  Owner holder(Owner shown) const noexcept { return in_flight_ == 0 ? shown : holder_; }
  /// A request that makes this owner the holder is on its way; 0: one that ends the lease.
  void send(Owner next) noexcept {
    holder_ = next;
    ++in_flight_;
  }
  /// The bench has answered the first of them, and the newest sample shows the effect.
  void answered() noexcept { --in_flight_; }

 private:
  std::uint64_t in_flight_ = 0;
  Owner holder_ = 0;
};

/// Parameters of an axis from the tick thread.
struct ParameterMail {
  static constexpr std::size_t kMaxParameters = 256;
  using Values = std::array<double, kMaxParameters>;

  Mailbox<Values> newest;
  std::uint64_t sent = 0;       ///< tick thread: number of changes in the mailbox
  Values in_force{};            ///< I/O thread: the last received values
  std::uint64_t in_flight = 0;  ///< I/O thread: writes without an answer yet

  static Values values_of(const AxisParameters& p) noexcept {
    const std::span<const Parameter> rows = axis_parameters(p);
    if (rows.size() > kMaxParameters) std::abort();
    Values values{};
    for (std::size_t row = 0; row < rows.size(); ++row)
      values[row] = rows[row].get(p);
    return values;
  }
};

}  // namespace drivebench
