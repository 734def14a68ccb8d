#pragma once

#include <functional>
#include <string>

#include "server/endpoints/tcp/session/dialogue.hpp"

namespace drivebench {

/// The user behind a session: the grant of the token, what its role allows, and when its time ends.
class Identity {
 public:
  explicit Identity(Dialogue& dialogue);

  /// Called with a sentence when the grant is no longer valid.
  std::function<void(const std::string&)> on_end;

  /// Checks the token of a hello; refuses the hello if no grant has this token.
  bool admit(const v1::Hello& hello);
  /// Whether the role allows the request; if not, refuses it.
  bool may_ask(const v1::Envelope& request);
  /// Called after a change of the tokens file: ends the session if its grant has gone or changed.
  void look_again();
  /// Ends the session when the time of the grant is over.
  void watch_slot();
  void stop_watching() { slot_timer_.cancel(); }

  const Grant& grant() const noexcept { return grant_; }

 private:
  Dialogue& dialogue_;
  Grant grant_;
  ServerTimer slot_timer_;
};

}  // namespace drivebench
