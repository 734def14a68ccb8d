#include "clients/link/can_bus.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <termios.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "clients/link/address.hpp"
#include "protocols/can/kernel_frame.hpp"
#include "protocols/can/msgpack.hpp"
#include "protocols/can/slcan.hpp"
#include "protocols/can/socketcand.hpp"

namespace drivebench::link {
namespace {

using namespace std::chrono_literals;
using can::Frame;
using Clock = CanBus::Clock;

std::string reason() {
  return std::generic_category().message(errno);
}

double seconds_since_1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// The kernel wakes recv() this often to look at the deadline: one call a frame instead of poll() and recv().
constexpr auto kPatience = 5ms;

void set_patience(const FileDescriptor& fd) {
  const timeval limit = {.tv_sec = 0, .tv_usec = std::chrono::microseconds(kPatience).count()};
  ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
}

template <class T>
void set_option(const FileDescriptor& fd, int level, int name, const T& value) {
  if (::setsockopt(fd.get(), level, name, &value, sizeof value) != 0) throw ConnectError(reason());
}

/// Datagrams until the deadline; 0 if none comes. `receive` gives what recv() gave for these flags.
template <class Receive>
std::size_t receive_datagram(const std::string& name, Clock::time_point until, Receive receive) {
  for (;;) {
    const bool at_once = until <= Clock::time_point::min() || until <= Clock::now();
    const ssize_t got = receive(at_once ? MSG_DONTWAIT : 0);
    if (got > 0) return static_cast<std::size_t>(got);
    if (got < 0 && errno == EINTR) return 0;
    if (got < 0 && errno != EAGAIN) throw LinkError(name + " failed: " + reason());
    if (got < 0 && at_once) return 0;
  }
}

// ---- socketcan ----

class SocketCanBus final : public CanBus {
 public:
  SocketCanBus(const CanAddress& address, std::span<const std::uint32_t> ids)
      : name_(to_string(address)), fd_(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
    if (!fd_.is_open()) throw ConnectError("this system has no CAN sockets: " + reason());
    try {
      set_option(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1);
      if (ids.empty()) {
        set_option(fd_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, can_err_mask_t{CAN_ERR_MASK});
      } else {
        filter(ids);
      }
      sockaddr_can here = {};
      here.can_family = AF_CAN;
      here.can_ifindex = static_cast<int>(::if_nametoindex(address.channel.c_str()));
      if (here.can_ifindex == 0 ||
          ::bind(fd_.get(), reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0) {
        throw ConnectError(reason());
      }
    } catch (const ConnectError& error) {
      throw ConnectError("there is no " + name_ + ": " + error.what());
    }
    set_patience(fd_);
  }

  void send(const Frame& frame) override {
    const canfd_frame out = can::raw_of(frame);
    const std::size_t size = frame.fd ? CANFD_MTU : CAN_MTU;
    // A full queue empties at the speed of the bus; poll() calls it writable all the same.
    for (const Clock::time_point give_up = Clock::now() + 1s; ::write(fd_.get(), &out, size) < 0;) {
      if (errno == EINTR) continue;
      if (errno != ENOBUFS || Clock::now() > give_up) throw LinkError(name_ + " failed: " + reason());
      std::this_thread::sleep_for(1ms);
    }
  }

  std::optional<Frame> receive(Clock::time_point until) override {
    canfd_frame in = {};
    const std::size_t size =
        receive_datagram(name_, until, [&](int flags) { return ::recv(fd_.get(), &in, sizeof in, flags); });
    if (size != CAN_MTU && size != CANFD_MTU) return std::nullopt;
    if (in.len > (size == CANFD_MTU ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) return std::nullopt;
    return can::frame_of(in, size == CANFD_MTU);
  }

 private:
  void filter(std::span<const std::uint32_t> ids) {
    const std::vector<can_filter> filters = can::filters_for({ids.begin(), ids.end()});
    if (::setsockopt(fd_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                     static_cast<socklen_t>(filters.size() * sizeof(can_filter))) != 0) {
      throw ConnectError(reason());
    }
  }

  std::string name_;
  FileDescriptor fd_;
};

// ---- udp_multicast ----

/// The virtual bus of python-can. What is sent comes from a port of its own, by which own frames are known.
class MulticastBus final : public CanBus {
 public:
  explicit MulticastBus(const CanAddress& address)
      : name_(to_string(address)),
        in_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)),
        out_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in group = {};
    group.sin_family = AF_INET;
    group.sin_port = htons(address.port);
    ::inet_pton(AF_INET, address.channel.c_str(), &group.sin_addr);
    const auto* peer = reinterpret_cast<const sockaddr*>(&group);
    try {
      set_option(in_, SOL_SOCKET, SO_REUSEADDR, 1);
      if (::bind(in_.get(), peer, sizeof group) != 0) throw ConnectError(reason());
      // Sent over the loopback interface, whatever the routes, and never beyond this computer.
      ip_mreqn request = {.imr_multiaddr = group.sin_addr,
                          .imr_address = {},
                          .imr_ifindex = static_cast<int>(::if_nametoindex("lo"))};
      set_option(in_, IPPROTO_IP, IP_ADD_MEMBERSHIP, request);
      set_option(out_, IPPROTO_IP, IP_MULTICAST_IF, request);
      set_option(out_, IPPROTO_IP, IP_MULTICAST_TTL, 0);
      // Where others send that do not choose an interface; there is none without a route.
      request.imr_ifindex = 0;
      ::setsockopt(in_.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request);
      if (::connect(out_.get(), peer, sizeof group) != 0) throw ConnectError(reason());
    } catch (const ConnectError& error) {
      throw ConnectError("there is no " + name_ + ": " + error.what());
    }
    sockaddr_in own = {};
    socklen_t size = sizeof own;
    ::getsockname(out_.get(), reinterpret_cast<sockaddr*>(&own), &size);
    own_port_ = own.sin_port;
    set_patience(in_);
  }

  void send(const Frame& frame) override {
    std::array<std::byte, can::kMaxMsgpackFrame> bytes{};
    const std::size_t size = can::encode_msgpack(frame, seconds_since_1970(), bytes);
    while (::send(out_.get(), bytes.data(), size, 0) < 0) {
      if (errno != EINTR) throw LinkError(name_ + " failed: " + reason());
    }
  }

  std::optional<Frame> receive(Clock::time_point until) override {
    for (;;) {
      std::array<std::byte, 4096> bytes{};
      sockaddr_in from = {};
      const std::size_t size = receive_datagram(name_, until, [&](int flags) {
        socklen_t from_size = sizeof from;
        return ::recvfrom(in_.get(), bytes.data(), bytes.size(), flags, reinterpret_cast<sockaddr*>(&from),
                          &from_size);
      });
      if (size == 0) return std::nullopt;
      const bool own = from.sin_port == own_port_;
      if (auto frame = own ? std::nullopt : can::decode_msgpack(std::span(bytes).first(size))) return frame;
      if (until <= Clock::now()) return std::nullopt;  // whatever else comes
    }
  }

 private:
  std::string name_;
  FileDescriptor in_;
  FileDescriptor out_;
  in_port_t own_port_ = 0;
};

// ---- texts over a stream ----

/// What slcan and socketcand have in common: bytes of a terminal or a TCP connection.
class TextBus : public CanBus {
 public:
  std::optional<Frame> receive(Clock::time_point until) override {
    while (frames_.empty()) {
      if (!read_some(until)) return std::nullopt;
    }
    const Frame frame = frames_.front();
    frames_.pop_front();
    return frame;
  }

 protected:
  TextBus(std::string name, FileDescriptor fd) : name_(std::move(name)), fd_(std::move(fd)) {
    ::fcntl(fd_.get(), F_SETFL, ::fcntl(fd_.get(), F_GETFL) | O_NONBLOCK);
  }

  virtual void take(char byte) = 0;
  void add(const Frame& frame) { frames_.push_back(frame); }

  void write(std::string_view text) {
    const Clock::time_point give_up = Clock::now() + 1s;
    while (!text.empty()) {
      ssize_t sent = ::send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL);
      if (sent < 0 && errno == ENOTSOCK) sent = ::write(fd_.get(), text.data(), text.size());
      if (sent >= 0) {
        text.remove_prefix(static_cast<std::size_t>(sent));
      } else if (errno == EAGAIN && Clock::now() < give_up) {
        wait_for(POLLOUT, give_up);
      } else if (errno != EINTR) {
        throw LinkError(name_ + " failed: " + reason());
      }
    }
  }

  /// False if nothing came in time or a signal did.
  bool read_some(Clock::time_point until) {
    if (!wait_for(POLLIN, until)) return false;
    std::array<char, 4096> bytes{};
    const ssize_t got = ::read(fd_.get(), bytes.data(), bytes.size());
    if (got == 0 || (got < 0 && errno == EIO)) throw LinkError(name_ + " was closed");
    if (got < 0 && errno != EAGAIN && errno != EINTR) throw LinkError(name_ + " failed: " + reason());
    for (const char byte : std::span(bytes).first(static_cast<std::size_t>(std::max<ssize_t>(got, 0))))
      take(byte);
    return true;
  }

  const std::string& name() const noexcept { return name_; }

 private:
  bool wait_for(short events, Clock::time_point until) {
    std::int64_t left_ms = 0;
    if (until > Clock::time_point::min()) {
      left_ms = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    }
    pollfd waiting = {.fd = fd_.get(), .events = events, .revents = 0};
    return ::poll(&waiting, 1, static_cast<int>(std::clamp<std::int64_t>(left_ms, 0, 60'000))) > 0;
  }

  std::string name_;
  FileDescriptor fd_;
  std::deque<Frame> frames_;
};

FileDescriptor open_slcan(const CanAddress& address, std::chrono::milliseconds deadline) {
  if (address.channel.starts_with("tcp:")) return connect_to(parse_address(address.channel), deadline);
  FileDescriptor fd(::open(address.channel.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios mode = {};
  if (!fd.is_open() || ::tcgetattr(fd.get(), &mode) != 0) {
    throw ConnectError("there is no terminal " + address.channel + ": " + reason());
  }
  ::cfmakeraw(&mode);
  ::tcsetattr(fd.get(), TCSANOW, &mode);
  return fd;
}

class SlcanBus final : public TextBus {
 public:
  SlcanBus(const CanAddress& address, std::chrono::milliseconds deadline)
      : TextBus(to_string(address), open_slcan(address, deadline)) {
    // Answers are not waited for: the other end of a pseudo terminal may say nothing.
    write("\rC\r" + std::string(*can::slcan_bit_rate(address.bit_rate)) + "\r" +
          (address.profile.fd ? std::string(*can::slcan_data_bit_rate(address.data_bit_rate)) + "\r" : "") +
          "O\r");
  }

  void send(const Frame& frame) override {
    text_.clear();
    can::append_slcan(text_, frame);
    write(text_);
  }

 private:
  void take(char byte) override {
    const auto line = reader_.push(byte);
    if (!line || line->refusal || line->too_long) return;
    if (const auto frame = can::parse_slcan(line->text)) add(*frame);
  }

  can::SlcanReader reader_;
  std::string text_;
};

class SocketcandBus final : public TextBus {
 public:
  SocketcandBus(const CanAddress& address, std::chrono::milliseconds deadline)
      : TextBus(to_string(address), connect_to(parse_address(address.channel), deadline)) {
    const Clock::time_point give_up = Clock::now() + deadline;
    expect("hi", give_up);
    write("< open " + address.bus + " >");
    expect("ok", give_up);
    write("< rawmode >");
    expect("ok", give_up);
  }

  void send(const Frame& frame) override {
    text_.clear();
    can::append_socketcand_send(text_, frame);
    write(text_);
  }

 private:
  void expect(std::string_view word, Clock::time_point give_up) {
    while (words_.empty()) {
      if (!read_some(give_up) && Clock::now() >= give_up) {
        throw ConnectError(name() + " does not say '" + std::string(word) + "'");
      }
    }
    const std::string said = std::move(words_.front());
    words_.pop_front();
    if (said != word) throw ConnectError(name() + " says '" + said + "', not '" + std::string(word) + "'");
    is_raw_ = word == "ok" && ++answers_ == 2;
  }

  void take(char byte) override {
    const auto element = reader_.push(byte);
    if (!element || element->bad) return;
    if (const auto timed = can::parse_socketcand_frame(element->text)) {
      add(timed->frame);
    } else if (!is_raw_) {
      words_.emplace_back(element->text);
    }
  }

  can::SocketcandReader reader_;
  std::deque<std::string> words_;  // answers to the opening, until all have come
  int answers_ = 0;
  bool is_raw_ = false;
  std::string text_;
};

struct Opening {
  const CanAddress& address;
  std::chrono::milliseconds deadline;
  std::span<const std::uint32_t> ids;
};
struct BusOpener {
  can::Backend backend;
  std::unique_ptr<CanBus> (*open)(const Opening& opening);
};
constexpr auto kBusOpeners = std::to_array<BusOpener>({
    {can::Backend::kSocketCan,
     [](const Opening& o) -> std::unique_ptr<CanBus> {
       return std::make_unique<SocketCanBus>(o.address, o.ids);
     }},
    {can::Backend::kUdpMulticast,
     [](const Opening& o) -> std::unique_ptr<CanBus> { return std::make_unique<MulticastBus>(o.address); }},
    {can::Backend::kSlcan,
     [](const Opening& o) -> std::unique_ptr<CanBus> {
       return std::make_unique<SlcanBus>(o.address, o.deadline);
     }},
    {can::Backend::kSocketcand,
     [](const Opening& o) -> std::unique_ptr<CanBus> {
       return std::make_unique<SocketcandBus>(o.address, o.deadline);
     }},
});
static_assert(kBusOpeners.size() == can::kBackends.size());

}  // namespace

std::unique_ptr<CanBus> open_can_bus(const CanAddress& address, std::chrono::milliseconds deadline,
                                     std::span<const std::uint32_t> ids) {
  return std::ranges::find(kBusOpeners, address.backend, &BusOpener::backend)
      ->open({.address = address, .deadline = deadline, .ids = ids});
}

}  // namespace drivebench::link
