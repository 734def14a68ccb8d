#include "server/access/admission.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace drivebench {

Admission::Decision Admission::admit(std::string_view token, const std::string& address, Time now,
                                     WallTime wall) {
  if (!asks_) return {.admitted = true, .grant = {.name = {}, .role = Role::kAdmin}};
  if (token.empty()) return {.looked_at = false, .why_not = "no token, and this bench asks for one"};
  if (const auto wait = guesses_.wait_of(address, now); wait > GuessLimit::Duration{}) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(wait);
    return {.looked_at = false,
            .why_not = fmt::format("after a wrong token this address has to wait another {:.1f} s",
                                   static_cast<double>(left.count()) * 1e-3)};
  }
  const Grant* grant = find_grant(grants_, token);
  if (grant != nullptr && grant->holds_at(wall)) {
    guesses_.note_right(address);
    return {.admitted = true, .grant = *grant};
  }
  guesses_.note_wrong(address, now);
  if (grant == nullptr) return {.why_not = "wrong token"};
  return {.why_not = grant->revoked ? "the token has been revoked" : "the time of the token is over"};
}

const Grant* Admission::renewed(const Grant& earlier, WallTime wall) const {
  if (!asks_) return &earlier;
  const auto found = std::find_if(grants_.begin(), grants_.end(),
                                  [&](const Grant& grant) { return grant.hash == earlier.hash; });
  return found != grants_.end() && found->holds_at(wall) ? &*found : nullptr;
}

}  // namespace drivebench
