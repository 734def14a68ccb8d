#pragma once

#include <bench.pb.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

namespace drivebench::web {

/// The subprotocols that Foxglove's app and SDK use. For a client that only subscribes both are the same.
inline constexpr std::string_view kFoxgloveSubprotocols[] = {"foxglove.sdk.v1", "foxglove.websocket.v1"};

/// The first of `offered` (a list with commas, as in Sec-WebSocket-Protocol) that is one of Foxglove's;
/// empty: none.
std::string_view foxglove_subprotocol(std::string_view offered) noexcept;

struct FoxgloveMessage {
  bool is_text = true;
  std::string bytes{};
};

/// The samples of an axis.
struct FoxgloveChannel {
  std::string topic{};
  bool is_subscribed = false;
  std::uint32_t subscription = 0;  ///< the client's number
  std::uint64_t lost = 0;          ///< samples that no status has told yet
  std::uint64_t last_tick = 0;     ///< of the newest sample
};

/// A client of Foxglove, without its socket: what it says becomes subscriptions of the bench, what the bench
/// says becomes messages for it. Each axis is a channel with the topic, the schema and the times of a
/// recording. Source: github.com/foxglove/ws-protocol, docs/spec.md.
///
/// A message is carried out whole or refused whole, by a status that names field, value and rule. While the
/// client reads too slowly samples are left out, and a status says how many.
class FoxgloveSession {
 public:
  static constexpr std::size_t kSamplesLimit = std::size_t{256} * 1024;
  static constexpr std::size_t kLimit = std::size_t{4} * 1024 * 1024;

  /// Server info and channels wait at once.
  explicit FoxgloveSession(const v1::Welcome& welcome);

  /// A text of the client. Gives the subscriptions that the bench needs for it; empty: none, or a refusal.
  std::vector<v1::Subscribe> text(std::string_view text);
  /// A binary message, which no client of this server may send.
  void binary(std::string_view bytes);
  void from_bench(const v1::Envelope& envelope);

  /// Swaps the next message into `message`; false: none waits.
  bool next(FoxgloveMessage& message);
  /// The client has taken no answers for too long.
  bool is_full() const noexcept { return waiting_bytes_ > kLimit; }

 private:
  void put(bool is_text, std::string bytes);
  void tell(int level, std::string_view sentence, std::string_view id = {});
  void send(const v1::Samples& samples);
  void send_time(std::uint64_t time_ns);

  std::deque<FoxgloveMessage> waiting_;
  std::size_t waiting_bytes_ = 0;
  std::vector<FoxgloveChannel> channels_;  // by axis
  double period_ns_;
  std::uint64_t time_ns_ = 0;  // the newest that was sent
};

}  // namespace drivebench::web
