#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>

namespace drivebench::speed {

/// Hostile clients at a server, on a thread of the lowest priority until this object goes: they stand for
/// other computers, and no measured thread may wait for them.
class Attackers {
 public:
  /// One round of an attack, which is repeated; it must not wait.
  using Round = std::function<void()>;

  explicit Attackers(Round round);
  ~Attackers();
  Attackers(const Attackers&) = delete;
  Attackers& operator=(const Attackers&) = delete;

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Sessions that send frames of 64 KiB as fast as they are answered; a parser without bounds makes 14 MB of
/// each.
Attackers::Round large_frames(const std::string& address, const std::string& token);
/// Connections that say nothing, each renewed when the server has closed it.
Attackers::Round crowd_at_the_door(const std::string& address);
/// Clients that guess tokens, each with a connection of its own.
Attackers::Round wrong_tokens(const std::string& address);
/// Sessions of a known user that ask for what its role forbids.
Attackers::Round forbidden_requests(const std::string& address, const std::string& token);

}  // namespace drivebench::speed
