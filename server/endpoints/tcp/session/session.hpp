#pragma once

#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "bench.pb.h"
#include "protocols/framing.hpp"
#include "server/endpoints/deadline.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/endpoints/tcp/session/identity.hpp"
#include "server/endpoints/tcp/session/requests/exchanges.hpp"
#include "server/endpoints/tcp/session/requests/fetch.hpp"
#include "server/endpoints/tcp/session/requests/leases.hpp"
#include "server/endpoints/tcp/session/requests/scope_trigger.hpp"
#include "server/endpoints/tcp/session/requests/states.hpp"
#include "server/endpoints/tcp/session/requests/subscriptions.hpp"
#include "server/endpoints/tcp/session/requests/uploads.hpp"
#include "server/endpoints/tcp/session/shared_memory/gate_level.hpp"
#include "server/endpoints/tcp/session/shared_memory/shared_exchanges.hpp"

namespace drivebench {

/// One client on a stream socket: hello first, then requests. Every request gets an answer with its id; a
/// refusal has a code, a sentence and the field. An error ends this session and nothing else.
///
/// This class cuts the stream into frames and gives each request to the part that answers it.
class Session : public std::enable_shared_from_this<Session> {
 public:
  /// `client` has no subject yet; hello gives it. `place` is the number of its place among the strangers.
  Session(Outbox::Socket socket, Client client, SessionContext& context, Places::Number place);

  /// Reads and answers until the peer or an error ends the session, then gives its leases back.
  asio::awaitable<void> run();

  /// Called when an experiment may have more data.
  void on_experiments() { fetch_.go_on(); }
  /// Called when an administrator has taken an axis from this session or another one.
  void on_taken(const Taken& taken) { leases_.on_taken(taken); }
  /// Called when the tokens file has changed.
  void on_new_grants();
  /// Called by the TLS door when the peer takes nothing.
  void on_deaf() { dialogue_.outbox().cut_deaf(); }

  /// Refuses the connection because it has no place, and ends it.
  void turn_away(const std::string& sentence);
  void close();

 private:
  static constexpr auto kHelloLimit = std::chrono::seconds(2);
  static constexpr auto kFrameLimit = std::chrono::seconds(2);  ///< of silence within a frame
  /// The most requests of this session in a turn; then the other sessions have theirs.
  static constexpr int kRequestsPerTurn = 64;
  static constexpr std::size_t kReplyBytesPerTurn = std::size_t{16} * 1024;

  /// The progress of a turn through the received frames.
  enum class Turn { kAll, kMoreToCome, kOver };
  Turn take_turn();
  ServerClock::duration due_pause();
  asio::awaitable<void> rest(ServerTimer& timer, ServerClock::duration pause);
  bool handle(std::span<const std::byte> frame);
  bool dispatch(const v1::Envelope& request);
  bool greet(const v1::Hello& hello);
  void welcome();
  bool end_without_place(const std::string& sentence);
  bool end_malformed(v1::RefusalCode code, const std::string& sentence, const char* field);
  void watch_for_silence();
  void end(const std::string& sentence);

  Dialogue dialogue_;
  Identity identity_;
  Subscriptions subscriptions_;
  ScopeTrigger trigger_;
  Leases leases_;
  Exchanges exchanges_;
  SharedExchanges shared_exchanges_;
  GateLevel gate_level_;
  States states_;
  Uploads uploads_;
  Fetch fetch_;
  Places::Number place_;
  FrameReader reader_;
  Deadline silence_;  // runs until hello, and while a frame is not whole
  bool greeted_ = false;
  bool over_ = false;  // the peer has gone
  std::string why_ended_ = "the peer left";
};

}  // namespace drivebench
