#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <string>

#include "server/host/clock.hpp"

namespace drivebench {

/// Slows guessing of secrets down. After a wrong one no secret of the same address is read for half a second,
/// after the next wrong one for twice as long, up to half a minute. So an address has at most two guesses a
/// minute in the long run, over any number of connections. After a right secret the waits are short again.
class GuessLimit {
 public:
  using Time = ServerClock::time_point;
  using Duration = ServerClock::duration;

  static constexpr Duration kFirstWait = std::chrono::milliseconds(500);
  static constexpr Duration kLongestWait = std::chrono::seconds(30);
  /// An address that has been quiet for so long after its wait begins anew.
  static constexpr Duration kForgotten = std::chrono::minutes(10);
  static constexpr std::size_t kMaxAddresses = 1024;

  /// So many wrong secrets of an address are mistakes, after which it need not wait.
  explicit GuessLimit(unsigned mistakes = 0) : mistakes_(mistakes) {}

  /// The rest of the wait; 0: a secret of this address may be read. `address` is as of address_of().
  Duration wait_of(const std::string& address, Time now) const;
  void note_wrong(const std::string& address, Time now);
  void note_right(const std::string& address);

  std::size_t addresses_that_wait() const noexcept { return guesses_.size(); }

 private:
  struct Guesses {
    unsigned wrong = 0;
    Duration wait{};  ///< after the last wrong secret
    Time until{};     ///< none is read before
  };

  void make_room(Time now);

  unsigned mistakes_;
  std::map<std::string, Guesses> guesses_;  // by address
};

}  // namespace drivebench
