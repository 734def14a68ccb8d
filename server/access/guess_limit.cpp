#include "server/access/guess_limit.hpp"

#include <algorithm>

namespace drivebench {

GuessLimit::Duration GuessLimit::wait_of(const std::string& address, Time now) const {
  const auto found = guesses_.find(address);
  return found == guesses_.end() ? Duration{} : std::max(found->second.until - now, Duration{});
}

void GuessLimit::note_wrong(const std::string& address, Time now) {
  make_room(now);
  Guesses& guesses = guesses_[address];
  if (now - guesses.until > kForgotten) guesses = {};
  if (++guesses.wrong > mistakes_) guesses.wait = std::clamp(2 * guesses.wait, kFirstWait, kLongestWait);
  guesses.until = now + guesses.wait;
}

/// Keeps the number of wrong secrets: otherwise a guesser beside a client with the right one would have its
/// mistakes again and again.
void GuessLimit::note_right(const std::string& address) {
  const auto found = guesses_.find(address);
  if (found != guesses_.end()) found->second.wait = {};
}

/// Keeps the table bounded: drops addresses whose wait is long over, and if that is not enough, the address
/// whose wait ends first.
void GuessLimit::make_room(Time now) {
  if (guesses_.size() < kMaxAddresses) return;
  std::erase_if(guesses_, [now](const auto& entry) { return now - entry.second.until > kForgotten; });
  if (guesses_.size() < kMaxAddresses) return;
  guesses_.erase(std::min_element(guesses_.begin(), guesses_.end(), [](const auto& x, const auto& y) {
    return x.second.until < y.second.until;
  }));
}

}  // namespace drivebench
