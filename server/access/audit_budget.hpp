#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "server/access/allowance.hpp"

namespace drivebench {

/// The refusals of unknown clients that the audit log has room for: for each kind of event, and within it for
/// each address, so that a flood costs neither another kind nor another address its lines.
class AuditBudget {
 public:
  using Time = ServerClock::time_point;

  static constexpr Allowance::Rate kOfAddress{.at_once = 100.0, .per_s = 2.0};  ///< within a kind
  static constexpr Allowance::Rate kOfKind{.at_once = 400.0, .per_s = 10.0};
  static constexpr std::size_t kMaxAddresses = 1024;  ///< of all kinds

  /// Whether there is room for one more, which it takes.
  bool take(std::string_view kind, const std::string& address, Time now);

  std::size_t addresses() const noexcept { return of_address_.size(); }

 private:
  using Key = std::pair<std::string, std::string>;  // kind, address

  void make_room();

  std::map<Key, Allowance> of_address_;
  std::map<std::string, Allowance> of_kind_;
};

}  // namespace drivebench
