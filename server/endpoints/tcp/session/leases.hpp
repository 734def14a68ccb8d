#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/access/seat.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"

namespace drivebench {

/// The leases of a session: a seat for each axis, all under one owner number.
class Leases {
 public:
  explicit Leases(Dialogue& dialogue);

  /// Called when the session no longer holds this axis.
  std::function<void(std::uint32_t axis)> on_gone;

  /// Acquires, renews, releases, or takes by force.
  void lease(const v1::LeaseRequest& request);
  /// An administrator has taken an axis from a session, this one or another.
  void on_taken(const Taken& taken);
  /// The session is over: its leases end as lost ones, and so does one that is granted from now on.
  void lose_all();

  /// Whether the session may change things at this axis; if not, refuses the request.
  bool may_change(std::uint32_t axis);
  /// Why the session does not hold the axis, for a refusal.
  std::string not_owner_of(std::uint32_t axis) const;
  /// Asks the bench under the owner number of the session; the client has the answer.
  void ask(const Input& input, const char* field);

 private:
  void take(const v1::LeaseRequest& request, Engine::Answer answer);
  Engine::Answer answer_for(std::uint32_t axis, const char* field, std::function<void()> on_done);
  void refuse_owned(std::uint64_t id, std::uint32_t axis);

  Dialogue& dialogue_;
  Engine& engine_;
  std::vector<Seat> seats_;         // by axis
  std::vector<std::string> taken_;  // by axis: the administrator that took it, and why
  bool over_ = false;
};

}  // namespace drivebench
