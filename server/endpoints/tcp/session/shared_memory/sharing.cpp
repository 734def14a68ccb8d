#include "server/endpoints/tcp/session/shared_memory/sharing.hpp"

#include <cerrno>
#include <string>
#include <system_error>
#include <vector>

#include "protocols/shm/segment.hpp"

namespace drivebench {

bool may_share(Dialogue& dialogue, std::uint32_t spin_us, bool shares_already) {
  const auto refuse = [&dialogue](v1::RefusalCode code, const std::string& sentence, const char* field) {
    dialogue.refuse(dialogue.id(), code, sentence, field);
    return false;
  };
  if (dialogue.client().transport != "unix") {
    return refuse(v1::REFUSAL_NOT_AVAILABLE,
                  "memory is shared over the unix socket of the bench only (shm:PATH), not over " +
                      dialogue.client().transport,
                  "kind");
  }
  if (spin_us > shm::kMaxSpinUs) {
    return refuse(
        v1::REFUSAL_OUT_OF_RANGE,
        "spin_us is " + std::to_string(spin_us) + " but must be 0 to " + std::to_string(shm::kMaxSpinUs),
        "spin_us");
  }
  if (shares_already) return refuse(v1::REFUSAL_BUSY, "this session shares memory already", "kind");
  if (!dialogue.outbox().idle())
    return refuse(v1::REFUSAL_BUSY, "the session has not read its earlier answers; then ask again", "kind");
  return true;
}

void answer_with_memory(Dialogue& dialogue, std::size_t bytes,
                        const std::function<std::ptrdiff_t(std::span<const std::byte>)>& send) {
  dialogue.begin_reply(dialogue.id()).mutable_shared_memory()->set_bytes(bytes);
  std::vector<std::byte>& reply = dialogue.encode_reply();
  const std::ptrdiff_t sent = send(reply);
  if (sent < 0) throw std::system_error(errno, std::generic_category(), "the socket takes no descriptors");
  reply.erase(reply.begin(), reply.begin() + sent);
  if (!reply.empty()) dialogue.send_scratch();
}

}  // namespace drivebench
