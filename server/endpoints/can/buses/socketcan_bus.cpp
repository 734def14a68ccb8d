#include "server/endpoints/can/buses/socketcan_bus.hpp"
#include "protocols/can/formats/kernel_frame.hpp"
#include "server/endpoints/can/buses/backends.hpp"
#include "server/endpoints/can/buses/error_report.hpp"
#include "server/endpoints/can/buses/virtual_bus.hpp"
#include "server/host/logging/log.hpp"

#include <fmt/core.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>

namespace drivebench::can {
namespace {

constexpr auto kProbeEvery = std::chrono::milliseconds(100);
constexpr int kFramesPerRead = 32;  // then other handlers on the I/O thread have their turn
constexpr std::size_t kFramesPerSend = 16;

void set_option(int fd, int level, int name, const void* value, std::size_t size, const char* what) {
  if (::setsockopt(fd, level, name, value, static_cast<socklen_t>(size)) != 0) {
    throw std::system_error(errno, std::generic_category(), what);
  }
}

void switch_on(int fd, int level, int name, const char* what) {
  const int on = 1;
  set_option(fd, level, name, &on, sizeof on, what);
}

ifreq request_for(const std::string& interface) {
  ifreq request{};
  interface.copy(request.ifr_name, IFNAMSIZ - 1);
  return request;
}

bool is_hardware(const std::string& interface) {
  std::error_code no_such_place;
  return std::filesystem::exists("/sys/class/net/" + interface + "/device", no_such_place);
}

/// The arrival of the frame on CLOCK_REALTIME. A controller's own stamp is better than the system's if it
/// counts from the same epoch; many controllers count from the moment when they were plugged in.
std::int64_t stamp_of(const scm_timestamping& stamps) {
  const auto ns = [](const timespec& t) { return std::int64_t{1'000'000'000} * t.tv_sec + t.tv_nsec; };
  const std::int64_t system = ns(stamps.ts[0]);
  const std::int64_t hardware = ns(stamps.ts[2]);
  constexpr std::int64_t kNear_ns = 1'000'000'000;
  return hardware != 0 && (system == 0 || std::abs(system - hardware) < kNear_ns) ? hardware : system;
}

/// The wait for room: at least the time of the longest classic frame, 8 bytes with the most stuff bits, and
/// long enough that a bus without listeners does not take a core.
std::chrono::nanoseconds retry_after(const CanConfig& config) {
  const std::chrono::nanoseconds frame(135 * std::int64_t{1'000'000'000} / config.bit_rate);
  return std::max<std::chrono::nanoseconds>(frame, std::chrono::milliseconds(1));
}

}  // namespace

SocketCanBus::SocketCanBus(asio::io_context& io, const CanConfig& config, bool confirm_virtual)
    : io_(io), config_(config), confirm_virtual_(confirm_virtual), stream_(io), retry_(io), probe_(io) {
  problem_ = open();
  if (problem_.empty()) return;
  if (config_.required) throw std::runtime_error(fmt::format("{}: {}", name(), problem_));
  log::warn("{}: {}; it is tried again every 100 ms", name(), problem_);
  probe_later();
}

// ---- the socket ----

std::string SocketCanBus::interface_problem(int fd) const {
  ifreq request = request_for(config_.channel);
  const bool exists = config_.channel.size() < IFNAMSIZ && ::ioctl(fd, SIOCGIFHWADDR, &request) == 0;
  if (!exists) {
    return fmt::format(
        "there is no such interface; a virtual one: modprobe vcan; ip link add dev {0} type vcan; ip link "
        "set {0} mtu 72; ip link set {0} up",
        config_.channel);
  }
  if (request.ifr_hwaddr.sa_family != ARPHRD_CAN) return "it is no CAN interface";
  if (::ioctl(fd, SIOCGIFMTU, &request) == 0 && config_.profile.fd && request.ifr_mtu < int{CANFD_MTU}) {
    return fmt::format(
        "it carries classic frames only; a virtual one: ip link set {0} down; ip link set {0} mtu 72; ip "
        "link set {0} up; others: drivebench can check {0}",
        config_.channel);
  }
  return {};
}

void SocketCanBus::set_options(int fd) {
  apply_filter(fd);
  const can_err_mask_t errors = CAN_ERR_MASK;
  set_option(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors, "CAN_RAW_ERR_FILTER");
  switch_on(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, "CAN_RAW_FD_FRAMES");
  if (confirm_virtual_ || is_hardware(config_.channel)) {
    switch_on(fd, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, "CAN_RAW_RECV_OWN_MSGS");
  }
  switch_on(fd, SOL_SOCKET, SO_RXQ_OVFL, "SO_RXQ_OVFL");
  const int stamps = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE | SOF_TIMESTAMPING_RX_HARDWARE |
                     SOF_TIMESTAMPING_RAW_HARDWARE;
  set_option(fd, SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof stamps, "SO_TIMESTAMPING");
  set_buffer(fd);
}

void SocketCanBus::set_buffer(int fd) {
  // 100 ms of the shortest frames: 47 bits, or for FD 29 bits at the nominal rate. The kernel charges about 1
  // KiB for a frame, and doubles the requested size.
  const std::int64_t frames = config_.bit_rate / 10 / (config_.profile.fd ? 29 : 47) + 1;
  const int bytes = static_cast<int>(std::clamp<std::int64_t>(frames * 1024 / 2, 1 << 18, 1 << 24));
  if (::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) == 0) return;
  set_option(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes, "SO_RCVBUF");
  int granted = 0;
  socklen_t size = sizeof granted;
  if (::getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted, &size) == 0 && granted < bytes * 2) {
    log::info("{}: the receive buffer holds {} ms of a full bus; for 100: sysctl net.core.rmem_max={}",
              name(), 100 * std::int64_t{granted} / (2 * std::int64_t{bytes}), bytes);
  }
}

void SocketCanBus::apply_filter(int fd) const {
  if (!filtered_) return;  // the kernel's default passes every frame
  set_option(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filter_.data(), filter_.size() * sizeof(can_filter),
             "CAN_RAW_FILTER");
}

void SocketCanBus::set_filter(const std::vector<std::uint32_t>& ids) {
  filter_ = filters_for(ids);
  filtered_ = filter_.size() <= CAN_RAW_FILTER_MAX;
  if (!filtered_) {
    log::warn("{}: the kernel takes {} filters, not {}; foreign frames wake the bench", name(),
              CAN_RAW_FILTER_MAX, filter_.size());
  }
  if (!stream_.is_open()) return;
  try {
    apply_filter(stream_.native_handle());
  } catch (const std::system_error& error) {
    log::warn("{}: {}; foreign frames wake the bench", name(), error.what());
  }
}

std::string SocketCanBus::open() {
  const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd < 0) {
    return fmt::format("no CAN sockets ({}); modprobe can_raw, or use another back end",
                       std::strerror(errno));
  }
  if (!adopt(stream_, fd)) return std::strerror(errno);
  std::string problem = interface_problem(fd);
  if (problem.empty()) try {
      set_options(fd);
      index_ = static_cast<int>(::if_nametoindex(config_.channel.c_str()));
      sockaddr_can address{};
      address.can_family = AF_CAN;
      address.can_ifindex = index_;
      // Index 0 would bind to all interfaces.
      if (index_ == 0 || ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
        throw std::system_error(index_ == 0 ? ENODEV : errno, std::generic_category(), "bind");
      }
    } catch (const std::system_error& error) {
      problem = error.what();
    }
  if (!problem.empty()) {
    close();
    return problem;
  }
  lost_before_ = 0;
  ifreq request = request_for(config_.channel);
  const bool up = ::ioctl(fd, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) != 0;
  set_state(up ? BusState::kUp : BusState::kDown);
  if (!up) {
    log::warn("{}: the interface is down; ip link set {} up", name(), config_.channel);
    probe_later();
  }
  wait();
  return {};
}

void SocketCanBus::close() {
  boost::system::error_code ignored;
  stream_.close(ignored);
  retry_.cancel();
  status_.send_dropped += pending_.clear();
}

void SocketCanBus::set_state(BusState state) {
  if (std::exchange(status_.state, state) == state || !on_state) return;
  // Never called from inside send(), because the listener may send.
  asio::post(io_, [this, alive = std::weak_ptr(alive_)] {
    if (!alive.expired() && on_state) on_state();
  });
}

// ---- receiving ----

void SocketCanBus::wait() {
  stream_.async_wait(asio::posix::stream_descriptor::wait_read,
                     [this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
                       if (alive.expired() || error || !stream_.is_open()) return;
                       read();
                       if (stream_.is_open()) wait();  // calls back at once if frames are left
                     });
}

void SocketCanBus::read() {
  struct Slot {
    canfd_frame frame;
    alignas(cmsghdr) std::array<char, 128> control;
  };
  std::array<Slot, kFramesPerRead> slots;
  std::array<iovec, kFramesPerRead> data{};
  std::array<mmsghdr, kFramesPerRead> messages{};
  for (std::size_t i = 0; i < slots.size(); ++i) {
    data[i] = {.iov_base = &slots[i].frame, .iov_len = sizeof(canfd_frame)};
    messages[i].msg_hdr.msg_iov = &data[i];
    messages[i].msg_hdr.msg_iovlen = 1;
    messages[i].msg_hdr.msg_control = slots[i].control.data();
    messages[i].msg_hdr.msg_controllen = slots[i].control.size();
  }
  const int count = ::recvmmsg(stream_.native_handle(), messages.data(), kFramesPerRead, 0, nullptr);
  if (count < 0) return fail(errno);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i)
    take(messages[i], slots[i].frame);
}

void SocketCanBus::take(const mmsghdr& message, const canfd_frame& raw) {
  std::int64_t stamp_ns = 0;
  msghdr header = message.msg_hdr;
  for (cmsghdr* part = CMSG_FIRSTHDR(&header); part != nullptr; part = CMSG_NXTHDR(&header, part)) {
    if (part->cmsg_level != SOL_SOCKET) continue;
    if (part->cmsg_type == SO_TIMESTAMPING) {
      scm_timestamping stamps{};
      std::memcpy(&stamps, CMSG_DATA(part), sizeof stamps);
      stamp_ns = stamp_of(stamps);
    } else if (part->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t lost = 0;
      std::memcpy(&lost, CMSG_DATA(part), sizeof lost);
      status_.receive_dropped += lost - std::exchange(lost_before_, lost);  // 32 bits that wrap around
    }
  }
  const bool fd = message.msg_len == CANFD_MTU;
  if ((!fd && message.msg_len != CAN_MTU) || raw.len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) {
    ++status_.malformed;
    return;
  }
  const Frame frame = frame_of(raw, fd);
  if (frame.error) {
    ++status_.error_frames;
    if ((frame.id & CAN_ERR_CRTL) != 0 && (frame.data[1] & CAN_ERR_CRTL_RX_OVERFLOW) != 0) {
      ++status_.receive_dropped;
    }
    const BusState state = state_after(frame, status_.state);
    state == BusState::kDown ? go_down() : set_state(state);
  } else if ((header.msg_flags & MSG_CONFIRM) != 0) {
    ++status_.confirmed;
  } else {
    ++status_.received;
    if (on_frame) on_frame(frame, stamp_ns);
  }
}

void SocketCanBus::fail(int error) {
  switch (error) {
    case EAGAIN:
    case EINTR:
      return;
    case ENODEV:
    case ENXIO:  // a later interface of this name does not revive the socket
      close();
      set_state(BusState::kAbsent);
      return probe_later();
    default:  // ENETDOWN
      go_down();
  }
}

/// Notes that the interface is down. The socket is silent until the interface works again.
void SocketCanBus::go_down() {
  if (status_.state == BusState::kDown) return;
  retry_.cancel();
  status_.send_dropped += pending_.clear();
  set_state(BusState::kDown);
  probe_later();
}

// ---- sending ----

void SocketCanBus::send(const Frame& frame) {
  if (is_off()) {
    ++status_.send_dropped;
    return;
  }
  // Keeps the order: waiting frames go first.
  const Sent sent = pending_.empty() ? transmit(frame) : Sent::kFull;
  if (sent == Sent::kLost) ++status_.send_dropped;
  if (sent != Sent::kFull) return;
  if (pending_.empty()) retry_later();
  status_.send_dropped += pending_.push(frame);
}

void SocketCanBus::send_together(std::span<const Frame> frames) {
  if (pending_.empty() && !is_off() && frames.size() > 1) {
    std::array<canfd_frame, kFramesPerSend> raw{};
    std::array<iovec, kFramesPerSend> data{};
    std::array<mmsghdr, kFramesPerSend> messages{};
    const std::size_t count = std::min(frames.size(), kFramesPerSend);
    for (std::size_t i = 0; i < count; ++i) {
      raw[i] = raw_of(frames[i]);
      data[i] = {.iov_base = &raw[i], .iov_len = frames[i].fd ? CANFD_MTU : CAN_MTU};
      messages[i].msg_hdr.msg_iov = &data[i];
      messages[i].msg_hdr.msg_iovlen = 1;
    }
    const int sent =
        ::sendmmsg(stream_.native_handle(), messages.data(), static_cast<unsigned>(count), MSG_NOSIGNAL);
    if (sent > 0) {
      status_.sent += static_cast<std::uint64_t>(sent);
      frames = frames.subspan(static_cast<std::size_t>(sent));
    }
  }
  // One by one: the rest, and the error of its first frame.
  Bus::send_together(frames);
}

SocketCanBus::Sent SocketCanBus::transmit(const Frame& frame) {
  const canfd_frame raw = raw_of(frame);
  if (::send(stream_.native_handle(), &raw, frame.fd ? CANFD_MTU : CAN_MTU, MSG_NOSIGNAL) >= 0) {
    ++status_.sent;
    return Sent::kYes;
  }
  const int error = errno;
  // The queue of the interface or the socket's share of it is full, although poll() reports it as writable.
  if (error == ENOBUFS || error == EAGAIN) return Sent::kFull;
  if (error != EINVAL && error != EMSGSIZE) fail(error);  // these two are errors of the frame
  return Sent::kLost;
}

void SocketCanBus::flush() {
  while (!pending_.empty()) {
    const Sent sent = transmit(pending_.front());
    if (sent == Sent::kFull) return retry_later();
    if (pending_.empty()) return;  // the bus went down, and the frames were given up
    if (sent == Sent::kLost) ++status_.send_dropped;
    pending_.pop();
  }
}

void SocketCanBus::retry_later() {
  retry_.expires_after(retry_after(config_));
  retry_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
    if (!alive.expired() && !error && stream_.is_open()) flush();
  });
}

// ---- coming back ----

void SocketCanBus::probe_later() {
  probe_.expires_after(kProbeEvery);
  probe_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
    if (!alive.expired() && !error) probe();
  });
}

void SocketCanBus::probe() {
  if (!stream_.is_open()) {
    const std::string problem = open();
    if (problem.empty()) {
      log::info("{}: open", name());
    } else {
      if (problem != problem_) log::warn("{}: {}", name(), problem);
      probe_later();
    }
    problem_ = problem;
    return;
  }
  if (status_.state != BusState::kDown) return;
  if (static_cast<int>(::if_nametoindex(config_.channel.c_str())) != index_) return fail(ENODEV);
  // A controller that is off the bus has no carrier: up, but not running.
  constexpr int kWorks = IFF_UP | IFF_RUNNING;
  const int fd = stream_.native_handle();
  ifreq request = request_for(config_.channel);
  const bool works = ::ioctl(fd, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & kWorks) == kWorks;
  // A user may have made the interface classic while it was down.
  if (works && interface_problem(fd).empty()) {
    set_state(BusState::kUp);
  } else {
    probe_later();
  }
}

std::unique_ptr<Bus> make_socketcan_bus(asio::io_context& io, const CanConfig& config) {
  return std::make_unique<SocketCanBus>(io, config);
}

}  // namespace drivebench::can
