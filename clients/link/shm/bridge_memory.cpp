#include "clients/link/shm/bridge_memory.hpp"

#include <sched.h>

#include <utility>

#include "clients/link/common/address.hpp"
#include "protocols/shm/futex.hpp"

namespace drivebench::link {
namespace {

[[noreturn]] void fail_ended(const std::string& peer) {
  throw LinkError(peer + " closed the connection");
}

}  // namespace

BridgeMemory::BridgeMemory(const FileDescriptor& memory, int socket, std::chrono::microseconds spin,
                           std::string peer)
    : peer_(std::move(peer)),
      memory_(memory, sizeof(shm::BridgeSegment), peer_),
      segment_(*static_cast<shm::BridgeSegment*>(memory_.address())),
      wait_{.spin = spin, .socket = socket} {
  const shm::BridgeHead head = segment_.head;
  const shm::BridgeHead ours;
  const bool is_ours = head.version == ours.version && head.state_size == ours.state_size &&
                       head.means_size == ours.means_size && memory_.bytes() == sizeof(shm::BridgeSegment);
  if (head.magic != ours.magic) refuse_memory(peer_, "is not that of a bridge");
  if (!is_ours) refuse_memory(peer_, "has another layout: bench and client are of different versions");
}

void BridgeMemory::ask() {
  shm::BridgeRequest& request = segment_.request;
  const shm::BridgeReply& reply = segment_.reply;
  request.cpu = ::sched_getcpu();
  request.number.store(++number_);
  if (reply.asleep.load() != 0) shm::wake(request.number);
  const bool may_spin = reply.cpu != request.cpu;
  const AnswerWait::End end = wait_.await(reply.number, number_, request.waits, may_spin, std::nullopt);
  if (end != AnswerWait::End::kAnswered) fail_ended(peer_);
}

void BridgeMemory::require_memory() {
  std::uint32_t number = number_;  // an exchange is not moved before what was read, as a plain load could be
  if (!segment_.reply.number.compare_exchange_strong(number, number)) fail_ended(peer_);
}

}  // namespace drivebench::link
