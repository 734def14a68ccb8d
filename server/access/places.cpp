#include "server/access/places.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include "server/access/address.hpp"

namespace drivebench {

/// The part of the reserve that a session with this role may use.
std::size_t Places::reserve_for(const std::string& address, Role role) const {
  const bool on_unix = address == kUnixAddress;
  if (!asks_for_token_) return on_unix ? kReserve : 0;
  if (role == Role::kAdmin) return kReserve;
  return on_unix || role >= Role::kOperator ? kReserve / 2 : 0;
}

/// Empty: there is a place for one more session.
std::string Places::why_full(const std::string& address, std::size_t reserve) const {
  if (sessions_.size() >= limits_.sessions + reserve) {
    return "this bench serves " + std::to_string(limits_.sessions) + " sessions at most";
  }
  const auto found = sessions_from_.find(address);
  const std::size_t count = found == sessions_from_.end() ? 0 : found->second;
  if (address == kUnixAddress || count < limits_.sessions_of_address + reserve) return {};
  return "this bench serves " + std::to_string(limits_.sessions_of_address) +
         " sessions of one address at most, and " + address + " has so many";
}

Places::Entry Places::enter(const std::string& address) {
  if (std::string full = why_full(address, reserve_for(address, Role::kAdmin)); !full.empty()) {
    return {.why_not = std::move(full)};
  }
  strangers_.emplace(++last_, Stranger{.address = address});
  const Number number = last_;
  if (strangers_.size() > kStrangers) displace_one();
  return {.number = number};
}

/// The newest stranger counts for its address, but keeps its place.
void Places::displace_one() {
  std::map<std::string, std::size_t> count;
  for (const auto& [number, stranger] : strangers_)
    ++count[stranger.address];
  if (const auto on_unix = count.find(std::string(kUnixAddress)); on_unix != count.end()) {
    on_unix->second -= std::min(on_unix->second, kStrangersOnUnix);
  }
  // The first of equals is the oldest.
  const auto gone =
      std::max_element(strangers_.begin(), std::prev(strangers_.end()), [&](const auto& x, const auto& y) {
        return std::tuple(count[x.second.address], x.second.silent) <
               std::tuple(count[y.second.address], y.second.silent);
      });
  const auto end = std::move(gone->second.end);
  strangers_.erase(gone);
  if (end) end("another client came, and too many sessions have not said hello yet");
}

void Places::on_displaced(Number number, std::function<void(const std::string&)> end) {
  if (const auto found = strangers_.find(number); found != strangers_.end())
    found->second.end = std::move(end);
}

void Places::heard(Number number) {
  if (const auto found = strangers_.find(number); found != strangers_.end()) found->second.silent = false;
}

std::string Places::admit(Number number, Role role) {
  const auto found = strangers_.find(number);
  if (found == strangers_.end()) return "this connection has no place";
  const std::string& address = found->second.address;
  if (std::string full = why_full(address, reserve_for(address, role)); !full.empty()) return full;
  ++sessions_from_[address];
  sessions_.emplace(number, address);
  strangers_.erase(found);
  return {};
}

void Places::leave(Number number) {
  strangers_.erase(number);
  const auto found = sessions_.find(number);
  if (found == sessions_.end()) return;
  const auto from = sessions_from_.find(found->second);
  if (--from->second == 0) sessions_from_.erase(from);
  sessions_.erase(found);
}

}  // namespace drivebench
