#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "protocols/signals/sample.hpp"
#include "server/bench/input.hpp"

namespace drivebench {

/// A client as people and the audit log name it.
struct Client {
  std::string transport;  ///< "tcp", "unix", "can" or "modbus"
  std::string peer;       ///< address and port, or the bus
  std::string subject;    ///< owner of the token; empty: unknown
};

/// The client's name in sentences: "anna (127.0.0.1:5000)".
inline std::string name_of(const Client& client) {
  const std::string place =
      client.transport == client.peer ? client.peer : client.transport + " " + client.peer;
  return client.subject.empty() ? place : client.subject + " (" + place + ")";
}

/// A lease was taken by force.
struct Taken {
  std::uint32_t axis;
  Owner from;
  Owner by;
  std::string reason;
};

/// Gives controllers their numbers, which only grow, and remembers the clients behind them: the last
/// thousand, and those that hold an axis.
class Owners {
 public:
  static constexpr std::size_t kRemembered = 1000;

  Owner add(Client client, std::span<const Sample> axes) {
    if (known_.size() >= kRemembered) {
      const auto idle = std::find_if(known_.begin(), known_.end(), [axes](const auto& entry) {
        return std::none_of(axes.begin(), axes.end(),
                            [&](const Sample& axis) { return axis.owner == entry.first; });
      });
      known_.erase(idle);
    }
    known_.emplace(++last_, std::move(client));
    return last_;
  }
  const Client* find(Owner owner) const {
    const auto found = known_.find(owner);
    return found == known_.end() ? nullptr : &found->second;
  }

 private:
  Owner last_ = 0;
  std::map<Owner, Client> known_;
};

}  // namespace drivebench
