#include "server/access/audit_budget.hpp"

#include <algorithm>
#include <chrono>

namespace drivebench {

/// The account, with what has come in since it was used last. A new one is full.
template <class AnyKey>
AuditBudget::Account& AuditBudget::brought_up(std::map<AnyKey, Account>& accounts, AnyKey key, Rate rate,
                                              Time now) {
  Account& account =
      accounts.try_emplace(std::move(key), Account{.left = rate.at_once, .at = now}).first->second;
  const double elapsed_s = std::chrono::duration<double>(now - account.at).count();
  account = {.left = std::min(account.left + rate.per_s * elapsed_s, rate.at_once), .at = now};
  return account;
}

bool AuditBudget::take(std::string_view kind, const std::string& address, Time now) {
  Key key{std::string(kind), address};
  if (!of_address_.contains(key)) make_room();
  Account& of_address = brought_up(of_address_, std::move(key), kOfAddress, now);
  Account& of_kind = brought_up(of_kind_, std::string(kind), kOfKind, now);
  if (of_address.left < 1.0 || of_kind.left < 1.0) return false;
  of_address.left -= 1.0;
  of_kind.left -= 1.0;
  return true;
}

/// Forgets the address that was refused least recently; what its kind has left still bounds it.
void AuditBudget::make_room() {
  if (of_address_.size() < kMaxAddresses) return;
  of_address_.erase(std::min_element(of_address_.begin(), of_address_.end(),
                                     [](const auto& x, const auto& y) { return x.second.at < y.second.at; }));
}

}  // namespace drivebench
