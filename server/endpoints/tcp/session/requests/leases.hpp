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
  /// Called when an administrator has taken an axis from this session or another one.
  void on_taken(const Taken& taken);
  /// Called at the end of the session: its leases end as lost, and so does any lease granted afterwards.
  void lose_all();

  /// Whether the session may change this axis, as its holder, as a conductor or in a free run; if not,
  /// refuses the request.
  bool may_change(std::uint32_t axis);
  /// Whether no other session holds an axis, or the session conducts; if not, refuses the request.
  bool has_bench_to_itself();
  /// The owner number of the session on an axis that it holds; 0, no owner, on any other.
  Owner sender(std::uint32_t axis) const;
  /// The reason why the session does not hold the axis, for a refusal.
  std::string not_owner_of(std::uint32_t axis) const;
  /// Sends the input to the bench under the owner number of the session, and the answer to the client.
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
