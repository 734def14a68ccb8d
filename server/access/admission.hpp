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

/// Who may come in: looks at tokens, and makes those wait who guess.
///
/// After a wrong token nobody from the same address is listened to for half a second, after the next one for
/// twice as long, up to half a minute: so nobody has more than two guesses a minute in the long run, however
/// many connections he makes. A right token makes that good.
class Admission {
 public:
  using Time = ServerClock::time_point;
  using WallTime = std::chrono::system_clock::time_point;

  static constexpr auto kFirstWait = std::chrono::milliseconds(500);
  static constexpr auto kLongestWait = std::chrono::seconds(30);
  /// An address that has been quiet for so long after its wait begins anew.
  static constexpr auto kForgotten = std::chrono::minutes(10);
  static constexpr std::size_t kMaxAddresses = 1024;

  /// Without `asks_for_token` everybody may come in as an administrator.
  Admission(bool asks_for_token, std::vector<Grant> grants)
      : asks_(asks_for_token), grants_(std::move(grants)) {}

  struct Decision {
    bool admitted = false;
    bool looked_at = true;  ///< false: the token was not looked at, its sender has to wait
    Grant grant{};          ///< of the subject; that of nobody in particular if no token is asked for
    std::string why_not{};  ///< one sentence
  };
  /// `address` is where the peer comes from, without its port.
  Decision admit(std::string_view token, const std::string& address, Time now, WallTime wall);

  /// What holds from now on.
  void replace(std::vector<Grant> grants) { grants_ = std::move(grants); }
  /// The grant that an earlier one has become; null: it holds no more.
  const Grant* renewed(const Grant& earlier, WallTime wall) const;

  std::size_t addresses_that_wait() const noexcept { return guesses_.size(); }

 private:
  struct Guesses {
    ServerClock::duration wait{};  ///< after the last one
    Time until{};                  ///< nothing is looked at before
  };

  void make_room(Time now);

  bool asks_;
  std::vector<Grant> grants_;
  std::map<std::string, Guesses> guesses_;  // by address
};

}  // namespace drivebench
