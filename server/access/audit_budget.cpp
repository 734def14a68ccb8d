#include "server/access/audit_budget.hpp"

#include <algorithm>

namespace drivebench {

bool AuditBudget::take(std::string_view kind, const std::string& address, Time now) {
  Key key{std::string(kind), address};
  if (!of_address_.contains(key)) make_room();
  Allowance& of_address = of_address_.try_emplace(std::move(key), kOfAddress, now).first->second;
  Allowance& of_kind = of_kind_.try_emplace(std::string(kind), kOfKind, now).first->second;
  if (of_address.left(now) < 1.0 || of_kind.left(now) < 1.0) return false;
  of_address.use();
  of_kind.use();
  return true;
}

/// Forgets the address that was refused least recently; what its kind has left still bounds it.
void AuditBudget::make_room() {
  if (of_address_.size() < kMaxAddresses) return;
  of_address_.erase(
      std::min_element(of_address_.begin(), of_address_.end(),
                       [](const auto& x, const auto& y) { return x.second.at() < y.second.at(); }));
}

}  // namespace drivebench
