#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/config/grants.hpp"
#include "server/host/clock.hpp"

namespace drivebench {

/// Decides whether a token opens a session, and slows guessing down.
///
/// After a wrong token the server reads no token from the same address for half a second, after the next
/// wrong one for twice as long, up to half a minute. So an address has at most two guesses a minute in the
/// long run, over any number of connections. A right token ends the wait.
class Admission {
 public:
  using Time = ServerClock::time_point;
  using WallTime = std::chrono::system_clock::time_point;

  static constexpr auto kFirstWait = std::chrono::milliseconds(500);
  static constexpr auto kLongestWait = std::chrono::seconds(30);
  /// An address that has been quiet for so long after its wait begins anew.
  static constexpr auto kForgotten = std::chrono::minutes(10);
  static constexpr std::size_t kMaxAddresses = 1024;

  /// Without `asks_for_token` every session is that of an administrator.
  Admission(bool asks_for_token, std::vector<Grant> grants)
      : asks_(asks_for_token), grants_(std::move(grants)) {}

  struct Decision {
    bool admitted = false;
    bool looked_at = true;  ///< false: the address must wait, and the token was not read
    Grant grant{};          ///< of the user; without a name if the server needs no token
    std::string why_not{};  ///< one sentence
  };
  /// `address` is where the peer comes from, without its port.
  Decision admit(std::string_view token, const std::string& address, Time now, WallTime wall);

  /// Puts these grants in place of those before.
  void replace(std::vector<Grant> grants) { grants_ = std::move(grants); }
  /// The present form of an earlier grant; null: it is no longer valid.
  const Grant* renewed(const Grant& earlier, WallTime wall) const;

  std::size_t addresses_that_wait() const noexcept { return guesses_.size(); }

 private:
  struct Guesses {
    ServerClock::duration wait{};  ///< after the last wrong token
    Time until{};                  ///< no token is read before
  };

  void make_room(Time now);

  bool asks_;
  std::vector<Grant> grants_;
  std::map<std::string, Guesses> guesses_;  // by address
};

}  // namespace drivebench
