#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "server/engine/engine.hpp"
#include "server/host/clock.hpp"

namespace drivebench {

/// The place of a transport for the client that holds the lease of an axis: it keeps the owner number under
/// which the bench knows the client. The bench alone grants and ends leases; a seat asks for them, remembers
/// what was granted, and notices that a lease has ended.
///
/// A seat is empty (owner() is 0) until a lease is granted, and again once the lease was released, lost,
/// taken by force or has run out. The transport says when the client last gave a sign of life and how much
/// silence it allows.
class Seat {
 public:
  using Clock = ServerClock;

  Seat(Engine& engine, std::uint32_t axis) : engine_(engine), axis_(axis) {}

  /// Number of the holder; 0: the seat is empty.
  Owner owner() const noexcept { return owner_; }
  /// Whether the lease still holds in the bench. An ended lease stays in the seat until notice_end().
  bool is_held() const { return owner_ != 0 && engine_.owner(axis_) == owner_; }
  /// Whether a request of this seat has no answer yet, and whether one of these is for a new lease.
  bool is_asking() const noexcept { return asking_ > 0; }
  bool is_acquiring() const noexcept { return acquiring_ > 0; }

  /// The number under which `client` asks for the lease: that of the seat, else a new one. A request that
  /// will be refused uses none up and has 0: the numbers that samples show depend only on granted leases.
  Owner number_for(const Client& client) const {
    if (owner_ != 0) return owner_;
    return engine_.may_be_acquired(axis_) ? engine_.new_owner(client) : 0;
  }

  /// Acquires, renews or releases the lease. When `answer` is called, the seat already follows the decision
  /// of the bench. `from` as in Engine::request(). The seat must live until then.
  void ask(LeaseAction action, Owner number, Engine::Answer answer, const Client* from = nullptr);
  /// Takes the axis from whichever client holds it.
  void take(Owner number, const std::string& reason, Engine::Answer answer);

  /// Ends the lease as that of a controller that has gone: the axis acts safely and latches the loss. The
  /// seat is empty at once.
  void lose(const Client* from = nullptr) { end(LeaseAction::kLost, from); }
  /// Releases the lease without an answer. The seat is empty at once.
  void give_back() { end(LeaseAction::kRelease, nullptr); }

  /// True once after the bench has ended the lease: it ran out or was taken. The seat is empty then.
  bool notice_end();
  /// True if the lease of this seat was taken by force. The seat is empty then.
  bool notice_taken(const Taken& taken);

  /// The client has given a sign of life.
  void hear(Clock::time_point now) noexcept { heard_ = now; }
  /// The client waits for the bench, which is not silence.
  void wait(Clock::time_point now) noexcept { waited_ = now; }
  Clock::time_point silent_since() const noexcept { return std::max(heard_, waited_); }
  bool is_silent(Clock::time_point now, Clock::duration limit) const noexcept {
    return now - silent_since() >= limit;
  }
  /// The same for a client that must give signs of life while it waits, too.
  bool is_unheard(Clock::time_point now, Clock::duration limit) const noexcept {
    return now - heard_ >= limit;
  }

 private:
  Engine::Answer answered(LeaseAction action, Owner number, Engine::Answer answer);
  void end(LeaseAction how, const Client* from);

  Engine& engine_;
  std::uint32_t axis_;
  Owner owner_ = 0;
  std::uint32_t asking_ = 0;
  std::uint32_t acquiring_ = 0;  // of these
  Clock::time_point heard_{};
  Clock::time_point waited_{};
};

}  // namespace drivebench
