#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "server/access/allowance.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"

namespace drivebench {

/// The user behind a session: the grant of the token, what its role allows, and when its time ends.
///
/// The audit log has a line for every request that the role forbids. A user whose sessions together ask for
/// more than kForbidden waits: the server pauses in reading the sessions that asked.
class Identity {
 public:
  static constexpr Allowance::Rate kForbidden{.at_once = 100.0, .per_s = 10.0};
  static constexpr auto kLongestPause = std::chrono::seconds(10);

  explicit Identity(Dialogue& dialogue);

  /// Called with a sentence when the grant is no longer valid.
  std::function<void(const std::string&)> on_end;

  /// Checks the token of a hello and what it asks for; refuses the hello if no grant has this token or if its
  /// role does not allow that.
  bool admit(const v1::Hello& hello);
  /// Whether the role allows the request; if not, refuses it.
  bool may_ask(const v1::Envelope& request);
  /// Whether the session has asked for what its user may not ask for now.
  bool must_pause();
  /// The pause for the forbidden requests since the last call.
  ServerClock::duration pause();
  /// Called after a change of the tokens file: ends the session if its grant has gone or changed.
  void look_again();
  /// Ends the session when the time of the grant is over.
  void watch_slot();
  void stop_watching() { slot_timer_.cancel(); }

  const Grant& grant() const noexcept { return grant_; }

 private:
  /// Whether the role is this one or a higher one; if not, refuses the request.
  bool is_at_least(Role needed, const std::string& field);
  Allowance& forbidden();

  Dialogue& dialogue_;
  Grant grant_;
  bool asked_forbidden_ = false;
  ServerTimer slot_timer_;
};

}  // namespace drivebench
