#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "server/config/grants.hpp"

namespace drivebench {

/// Decides which connections the server serves when more come than it has places for.
///
/// A connection is a stranger until its hello is accepted; then it is a session. For strangers there are
/// kStrangers places. When all are taken, a new stranger gets the place of another one: of the address that
/// has the most of them; there of one that has sent nothing yet, if any; of these the oldest. So a crowd from
/// one address costs other addresses nothing; a client of the same address keeps its place unless kStrangers
/// newer ones come before the server reads its hello.
///
/// For sessions there are as many places as the configuration says, and a share of them for each address.
/// Beyond both, kReserve more: half of them for operators and clients on the unix socket, all of them for
/// administrators. On a bench without tokens every session is an administrator, so that only the unix socket
/// tells its own users from others: the reserve is for them.
class Places {
 public:
  /// Of a connection; 0: it has no place.
  using Number = std::uint64_t;

  struct Limits {
    std::size_t sessions = 256;
    std::size_t sessions_of_address = 256;
  };
  static constexpr std::size_t kStrangers = 32;
  /// Strangers on the unix socket that count for nothing when one has to go.
  static constexpr std::size_t kStrangersOnUnix = 8;
  static constexpr std::size_t kReserve = 16;

  Places(Limits limits, bool asks_for_token) : limits_(limits), asks_for_token_(asks_for_token) {}

  struct Entry {
    Number number = 0;
    std::string why_not{};  ///< one sentence
  };
  /// A new connection from this address. It gets no place if no role would make it a session.
  Entry enter(const std::string& address);
  /// Calls `end` with a sentence when another stranger gets the place of this one.
  void on_displaced(Number number, std::function<void(const std::string&)> end);
  /// The stranger has sent something.
  void heard(Number number);
  /// Makes the stranger a session; a sentence: there is no place for one with this role.
  std::string admit(Number number, Role role);
  /// The connection has ended. It may have lost its place before.
  void leave(Number number);

 private:
  struct Stranger {
    std::string address{};
    bool silent = true;
    std::function<void(const std::string&)> end{};
  };

  std::size_t reserve_for(const std::string& address, Role role) const;
  std::string why_full(const std::string& address, std::size_t reserve) const;
  void displace_one();

  Limits limits_;
  bool asks_for_token_;
  Number last_ = 0;
  std::map<Number, Stranger> strangers_;
  std::map<Number, std::string> sessions_;            // their addresses
  std::map<std::string, std::size_t> sessions_from_;  // by address
};

}  // namespace drivebench
