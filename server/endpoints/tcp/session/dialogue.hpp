#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bench.pb.h"
#include "server/endpoints/tcp/sending/outbox.hpp"
#include "server/endpoints/tcp/session/context.hpp"

namespace drivebench {

/// The common ground of the parts of a session: the client, the id of the present request, and the way back
/// to the client.
class Dialogue {
 public:
  /// `keep_alive` returns the session, which must live until the bench has answered its requests.
  Dialogue(Outbox::Socket socket, Client client, SessionContext& context,
           std::function<std::shared_ptr<void>()> keep_alive);

  Outbox::Socket& socket() noexcept { return socket_; }
  Outbox& outbox() noexcept { return outbox_; }
  Client& client() noexcept { return client_; }
  SessionContext& context() noexcept { return context_; }
  Engine& engine() const noexcept { return context_.engine; }
  std::size_t axis_count() const { return context_.engine.config().axes.size(); }
  /// The number of the session in the bench, which every `done` carries. 0: the session has asked for no
  /// lease.
  Owner owner() const noexcept { return owner_; }
  void set_owner(Owner owner) noexcept { owner_ = owner; }
  /// Whether the session may change axes that other sessions hold.
  bool conducts() const noexcept { return conducts_; }
  void set_conducts(bool conducts) noexcept { conducts_ = conducts; }
  std::shared_ptr<void> keep_alive() const { return keep_alive_(); }

  /// The id of the present request.
  std::uint64_t id() const noexcept { return id_; }
  void begin_request(std::uint64_t id) noexcept { id_ = id; }

  /// An empty message that answers the request with this id; send_reply() sends it.
  v1::Envelope& begin_reply(std::uint64_t id);
  void send_reply();
  /// The frame of the answer, in scratch().
  std::vector<std::byte>& encode_reply();
  /// For frames without an Envelope: send_scratch() sends the content of scratch().
  std::vector<std::byte>& scratch() noexcept { return context_.scratch; }
  void send_scratch();

  void done(std::uint64_t id, Tick tick);
  void refuse(std::uint64_t id, v1::RefusalCode code, const std::string& message, const char* field);
  void refuse(std::uint64_t id, Refused why, const char* field);
  /// The same with a sentence that says more than that of the table.
  void refuse(std::uint64_t id, Refused why, const std::string& sentence, const char* field);
  /// Counts and logs a request without the lease of its axis.
  void note_not_owner(Refused why);
  void notify(v1::Notice::Kind kind, const std::string& sentence, std::uint32_t axis);
  /// Writes a refusal into the log, with its kind, and into the audit log, as this event.
  void report(std::string_view event, std::string_view kind, std::string_view why,
              std::vector<AuditDetail> details = {});
  /// Writes a line in the audit log, if the bench has one.
  void audit(std::string_view event, std::string_view result, std::vector<AuditDetail> details);

  /// Whether the bench has this axis; if not, refuses the request.
  bool axis_exists(std::uint32_t axis);
  /// The reason why it has not.
  std::string no_such_axis(std::uint64_t axis) const;

  /// Counts the bytes of replies from here on.
  void begin_turn() noexcept { bytes_in_turn_ = 0; }
  std::size_t bytes_in_turn() const noexcept { return bytes_in_turn_; }

 private:
  Outbox::Socket socket_;
  Outbox outbox_;
  Client client_;
  SessionContext& context_;
  std::function<std::shared_ptr<void>()> keep_alive_;
  std::uint64_t id_ = 0;
  Owner owner_ = 0;
  bool conducts_ = false;
  std::size_t bytes_in_turn_ = 0;
};

/// The code on TCP for a refusal of the bench.
v1::RefusalCode code_of(Refused why) noexcept;

}  // namespace drivebench
