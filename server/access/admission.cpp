#include "server/access/admission.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace drivebench {

Admission::Decision Admission::admit(std::string_view token, const std::string& address, Time now,
                                     WallTime wall) {
  if (!asks_) return {.admitted = true, .grant = {.name = {}, .role = Role::kAdmin}};
  const auto found = guesses_.find(address);
  if (found != guesses_.end() && now < found->second.until) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(found->second.until - now);
    return {.looked_at = false,
            .why_not = fmt::format("after a wrong token this address has to wait another {:.1f} s",
                                   static_cast<double>(left.count()) * 1e-3)};
  }
  const Grant* grant = find_grant(grants_, token);
  if (grant != nullptr && grant->holds_at(wall)) {
    if (found != guesses_.end()) guesses_.erase(found);
    return {.admitted = true, .grant = *grant};
  }
  make_room(now);
  Guesses& guesses = guesses_[address];
  guesses.wait = std::clamp<ServerClock::duration>(2 * guesses.wait, kFirstWait, kLongestWait);
  guesses.until = now + guesses.wait;
  if (grant == nullptr) return {.why_not = "wrong or no token"};
  return {.why_not = grant->revoked ? "the token has been revoked" : "the time of the token is over"};
}

/// Keeps the table bounded: drops addresses whose wait is long over, and if that is not enough, the address
/// whose wait ends first.
void Admission::make_room(Time now) {
  if (guesses_.size() < kMaxAddresses) return;
  std::erase_if(guesses_, [now](const auto& entry) { return now - entry.second.until > kForgotten; });
  if (guesses_.size() < kMaxAddresses) return;
  guesses_.erase(std::min_element(guesses_.begin(), guesses_.end(), [](const auto& x, const auto& y) {
    return x.second.until < y.second.until;
  }));
}

const Grant* Admission::renewed(const Grant& earlier, WallTime wall) const {
  if (!asks_) return &earlier;
  const auto found = std::find_if(grants_.begin(), grants_.end(),
                                  [&](const Grant& grant) { return grant.hash == earlier.hash; });
  return found != grants_.end() && found->holds_at(wall) ? &*found : nullptr;
}

}  // namespace drivebench
