// Exchanges: over the socket, or in memory that the session shares with the bench.
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "clients/link/tcp/tcp_link.hpp"

namespace drivebench::link {

using Kind = v1::Envelope::KindCase;

Sample plain(const v1::Sample& message) {
  Sample sample;
#define DRIVEBENCH_UNSIGNED(kind, name, unit, maximum, meaning) sample.name = message.name();
#define DRIVEBENCH_SIGNED(kind, name, unit, first, minimum, maximum, meaning) sample.name = message.name();
#define DRIVEBENCH_REAL(kind, name, unit, minimum, maximum, meaning) sample.name = message.name();
#include "protocols/signals/signals.inc"
  return sample;
}

namespace {

/// All up to the last one with a level.
void add_edges(const std::array<EdgeRecord, kMaxLegEdges>& list,
               google::protobuf::RepeatedPtrField<v1::LegEdge>& out) {
  std::size_t count = list.size();
  while (count > 0 && list[count - 1].level == 0)
    --count;
  for (std::size_t n = 0; n < count; ++n) {
    v1::LegEdge& edge = *out.Add();
    edge.set_offset_ns(list[n].offset_ns);
    edge.set_level(static_cast<v1::LegLevel>(list[n].level));
  }
}

}  // namespace

std::span<const AxisSample> Link::exchange(std::span<const AxisCommand> commands) {
  if (memory_) return exchange_in_memory(commands);
  v1::Envelope& request = new_request();
  v1::Exchange& exchange = *request.mutable_exchange();
  for (const AxisCommand& from : commands) {
    v1::Command& to = *exchange.add_commands();
    to.set_axis(from.axis);
    to.set_tick(from.tick);
    to.set_gates(from.gates);
    to.set_u_a_v(from.u_a_v);
    to.set_u_b_v(from.u_b_v);
    to.set_u_c_v(from.u_c_v);
    to.set_u_f_v(from.u_f_v);
    to.set_i_a_a(from.i_a_a);
    to.set_i_b_a(from.i_b_a);
    to.set_i_c_a(from.i_c_a);
    to.set_i_f_a(from.i_f_a);
    to.set_d_a(from.d_a);
    to.set_d_b(from.d_b);
    to.set_d_c(from.d_c);
    to.set_d_f(from.d_f);
    to.set_legs_off(from.legs_off);
    if (from.gates == v1::GATES_EDGES) {
      add_edges(from.edges[0], *to.mutable_edges_a());
      add_edges(from.edges[1], *to.mutable_edges_b());
      add_edges(from.edges[2], *to.mutable_edges_c());
    }
  }
  samples_.clear();
  for (const v1::AxisSample& each : ask(request, Kind::kExchangeReply).exchange_reply().samples())
    samples_.push_back({.axis = each.axis(), .sample = plain(each.sample())});
  return samples_;
}

void Link::share_memory(std::chrono::microseconds spin) {
  v1::Envelope& request = new_request();
  request.mutable_share_memory()->set_spin_us(static_cast<std::uint32_t>(spin.count()));
  std::vector<FileDescriptor> taken = ask_for_memory(request, 2);
  memory_ = std::make_unique<SharedMemory>(taken[0], std::move(taken[1]), socket_.get(), spin, peer_);
}

std::unique_ptr<BridgeMemory> Link::share_bridge(std::uint32_t axis, std::chrono::microseconds spin) {
  v1::Envelope& request = new_request();
  v1::ShareBridge& wanted = *request.mutable_share_bridge();
  wanted.set_axis(axis);
  wanted.set_spin_us(static_cast<std::uint32_t>(spin.count()));
  const std::vector<FileDescriptor> taken = ask_for_memory(request, 1);
  return std::make_unique<BridgeMemory>(taken[0], socket_.get(), spin, peer_);
}

/// Returns the descriptors that came with the answer.
std::vector<FileDescriptor> Link::ask_for_memory(v1::Envelope& request, std::size_t count) {
  std::vector<FileDescriptor> taken;
  taken_ = &taken;
  try {
    ask(request, Kind::kSharedMemory);
  } catch (...) {
    taken_ = nullptr;
    throw;
  }
  taken_ = nullptr;
  if (taken.size() != count) {
    fail("sent " + std::to_string(taken.size()) + " descriptors with its shared memory where " +
         std::to_string(count) + " were due");
  }
  return taken;
}

std::ptrdiff_t Link::receive_with_descriptors(std::span<std::byte> space) {
  constexpr std::size_t kMost = 8;
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(kMost * sizeof(int))> control{};
  iovec part{.iov_base = space.data(), .iov_len = space.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const std::ptrdiff_t received = ::recvmsg(socket_.get(), &message, MSG_CMSG_CLOEXEC);
  if (received < 0) return received;
  for (cmsghdr* each = CMSG_FIRSTHDR(&message); each != nullptr; each = CMSG_NXTHDR(&message, each)) {
    if (each->cmsg_level != SOL_SOCKET || each->cmsg_type != SCM_RIGHTS) continue;
    for (std::size_t at = 0; CMSG_LEN(at + sizeof(int)) <= each->cmsg_len; at += sizeof(int)) {
      int descriptor = -1;
      std::memcpy(&descriptor, CMSG_DATA(each) + at, sizeof descriptor);
      taken_->emplace_back(descriptor);
    }
  }
  return received;
}

std::span<const AxisSample> Link::exchange_in_memory(std::span<const AxisCommand> commands) {
  if (!socket_.is_open()) throw LinkError("the link to " + peer_ + " is closed");
  const SharedMemory::Outcome outcome = memory_->exchange(commands, deadline_);
  if (outcome == SharedMemory::Outcome::kSamples) {
    if (is_subscribed_) keep_waiting_messages();
    return memory_->samples();
  }
  keep_waiting_messages();  // a notice may say why
  if (outcome == SharedMemory::Outcome::kRefused) throw RefusalError(memory_->refusal());
  if (outcome == SharedMemory::Outcome::kTooLate) fail_late();
  fail_ended(0);
}

/// Reads what has come over the socket meanwhile: the bench cuts off a session that does not.
void Link::keep_waiting_messages() {
  for (;;) {
    while (const v1::Envelope* envelope = next_envelope())
      keep_unasked(*envelope);
    const std::span<std::byte> space = reader_.free_space();
    const ssize_t received = ::recv(socket_.get(), space.data(), space.size(), MSG_DONTWAIT);
    if (received <= 0) return;  // the next request finds an end or an error
    reader_.received(static_cast<std::size_t>(received));
  }
}

}  // namespace drivebench::link
