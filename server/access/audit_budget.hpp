#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "server/host/clock.hpp"

namespace drivebench {

/// The refusals of unknown clients that the audit log has room for: for each kind of event, and within it for
/// each address, so that a flood costs neither another kind nor another address its lines.
class AuditBudget {
 public:
  using Time = ServerClock::time_point;

  /// So many at once, and so many a second after them.
  struct Rate {
    double at_once;
    double per_s;
  };
  static constexpr Rate kOfAddress{.at_once = 100.0, .per_s = 2.0};  ///< within a kind
  static constexpr Rate kOfKind{.at_once = 400.0, .per_s = 10.0};
  static constexpr std::size_t kMaxAddresses = 1024;  ///< of all kinds

  /// Whether there is room for one more, which it takes.
  bool take(std::string_view kind, const std::string& address, Time now);

  std::size_t addresses() const noexcept { return of_address_.size(); }

 private:
  struct Account {
    double left;
    Time at;
  };
  using Key = std::pair<std::string, std::string>;  // kind, address

  template <class AnyKey>
  static Account& brought_up(std::map<AnyKey, Account>& accounts, AnyKey key, Rate rate, Time now);
  void make_room();

  std::map<Key, Account> of_address_;
  std::map<std::string, Account> of_kind_;
};

}  // namespace drivebench
