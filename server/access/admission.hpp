#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/access/guess_limit.hpp"
#include "server/config/grants.hpp"
#include "server/host/clock.hpp"

namespace drivebench {

/// Decides whether a token opens a session; GuessLimit slows guessing down.
class Admission {
 public:
  using Time = ServerClock::time_point;
  using WallTime = std::chrono::system_clock::time_point;

  /// Without `asks_for_token` every session is that of an administrator.
  Admission(bool asks_for_token, std::vector<Grant> grants)
      : asks_(asks_for_token), grants_(std::move(grants)) {}

  struct Decision {
    bool admitted = false;
    bool looked_at = true;  ///< false: there was no token, or the address must wait and it was not read
    Grant grant{};          ///< of the user; without a name if the server needs no token
    std::string why_not{};  ///< one sentence
  };
  /// `address` is where the peer comes from, without its port. No token is no guess: a client that asks
  /// whether it needs one does not wait when it comes back with it.
  Decision admit(std::string_view token, const std::string& address, Time now, WallTime wall);

  /// Puts these grants in place of those before.
  void replace(std::vector<Grant> grants) { grants_ = std::move(grants); }
  /// The present form of an earlier grant; null: it is no longer valid.
  const Grant* renewed(const Grant& earlier, WallTime wall) const;

  std::size_t addresses_that_wait() const noexcept { return guesses_.addresses_that_wait(); }

 private:
  bool asks_;
  std::vector<Grant> grants_;
  GuessLimit guesses_;
};

}  // namespace drivebench
