#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/endpoints/tcp/memory/shared_segment.hpp"
#include "server/endpoints/tcp/sending/spinner.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/endpoints/tcp/session/requests/exchanges.hpp"

namespace drivebench {

/// The exchanges of a session through memory that it shares with the bench (protocols/shm/segment.hpp). They
/// mean what those over the socket mean, and are refused with the same sentences.
///
/// The I/O thread looks at the memory for a while after each exchange, and then waits for the client to ring.
class SharedExchanges final : public Spinner::Door, public Exchanges::Way {
 public:
  SharedExchanges(Dialogue& dialogue, Exchanges& exchanges);

  /// Answers with the memory, or refuses the request.
  void share(const v1::ShareMemory& request);
  /// The session has ended.
  void close();

  bool look(Spinner::Clock::time_point now) override;
  void answer(std::uint64_t id, std::span<const AxisSampleView> samples) override;
  void refuse(std::uint64_t id, v1::RefusalCode code, const std::string& sentence,
              const char* field) override;

 private:
  bool client_has_own_cpu();
  bool serve();
  void exchange(std::uint32_t number);
  void publish(std::uint64_t id);
  /// The client may ask again at any time.
  void expect();
  bool fall_asleep();
  void rest(ServerClock::duration pause);

  Dialogue& dialogue_;
  Exchanges& exchanges_;
  ServerTimer pause_;
  std::optional<SharedSegment> segment_;
  asio::local::stream_protocol::socket bell_;
  Spinner::Clock::duration spin_{};
  Spinner::Clock::time_point asked_{};  // the last exchange
  std::vector<shm::CommandRecord> commands_;
  std::uint32_t number_ = 0;           // of the last exchange
  std::array<std::byte, 64> rings_{};  // of the bell, whose content means nothing
  bool is_serving_ = false;
  bool waits_for_tick_ = false;
  bool waits_for_bell_ = false;
  bool rests_ = false;
  bool is_over_ = false;
};

}  // namespace drivebench
