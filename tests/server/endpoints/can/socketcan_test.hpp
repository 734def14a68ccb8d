#pragma once

#include <gtest/gtest.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "protocols/can/formats/kernel_frame.hpp"
#include "server/endpoints/can/buses/error_report.hpp"
#include "server/endpoints/can/buses/socketcan_bus.hpp"

namespace drivebench::can {

/// A wait of this length means that the test hangs.
inline constexpr auto kPatience = std::chrono::seconds(20);
inline constexpr auto kShort = std::chrono::milliseconds(5);

inline bool shell(const std::string& command) {
  return std::system((command + " 2>/dev/null").c_str()) == 0;
}

inline Frame data_frame(std::uint32_t id, std::uint8_t first = 0) {
  Frame frame{.id = id, .size = 8};
  frame.data[0] = first;
  return frame;
}

/// A raw socket of another program.
class Peer {
 public:
  explicit Peer(const std::string& interface)
      : fd_(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW)) {
    const int on = 1;
    EXPECT_EQ(::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on), 0);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;
  ~Peer() { ::close(fd_); }

  void send(std::uint32_t id_and_flags, std::initializer_list<std::uint8_t> data, bool fd = false) const {
    canfd_frame raw{};
    raw.can_id = id_and_flags;
    raw.len = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), raw.data);
    const auto size = fd ? CANFD_MTU : CAN_MTU;
    ASSERT_EQ(::send(fd_, &raw, size, 0), static_cast<ssize_t>(size));
  }
  /// Receives all frames that have come; waits for at least so many, as the kernel may deliver them later.
  std::vector<Frame> receive_all(std::size_t at_least = 0) const {
    const auto give_up = std::chrono::steady_clock::now() + kPatience;
    std::vector<Frame> frames;
    canfd_frame raw{};
    for (;;) {
      const ssize_t size = ::recv(fd_, &raw, sizeof raw, 0);
      if (size > 0) {
        frames.push_back(frame_of(raw, size == static_cast<ssize_t>(CANFD_MTU)));
        continue;
      }
      if (frames.size() >= at_least || std::chrono::steady_clock::now() > give_up) return frames;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

 private:
  int fd_;
};

class SocketCan : public testing::Test {
 protected:
  void SetUp() override {
    if (add_interface()) return;
    const char* why =
        "no vcan in this kernel, or not root; tests/peers/can/with_can runs this where there is one";
    if (std::getenv("DRIVEBENCH_CAN") != nullptr) FAIL() << why;
    GTEST_SKIP() << why;
  }
  void TearDown() override { shell("ip link del " + interface_); }

  bool add_interface(int mtu = 72) const {
    return shell("ip link add dev " + interface_ + " mtu " + std::to_string(mtu) + " type vcan") && set("up");
  }
  bool set(const std::string& what) const { return shell("ip link set " + interface_ + " " + what); }

  CanConfig config(bool required = true) const {
    CanConfig config;
    config.backend = Backend::kSocketCan;
    config.channel = interface_;
    config.required = required;
    config.profile.fd = false;
    return config;
  }
  /// Opens the bus; what it delivers goes to heard_ and states_.
  void open(const CanConfig& config, bool confirm_virtual = false) {
    bus_ = std::make_unique<SocketCanBus>(io_, config, confirm_virtual);
    bus_->on_frame = [this](const Frame& frame, std::int64_t stamp_ns) {
      heard_.push_back(frame);
      last_stamp_ns_ = stamp_ns;
    };
    bus_->on_state = [this] { states_.push_back(bus_->status().state); };
  }
  template <class Done>
  [[nodiscard]] bool run_until(Done done) {
    const auto give_up = std::chrono::steady_clock::now() + kPatience;
    while (!done() && std::chrono::steady_clock::now() < give_up) {
      io_.restart();
      io_.run_one_for(kShort);
    }
    return done();
  }
  [[nodiscard]] bool run_until_heard(std::size_t frames) {
    return run_until([&] { return heard_.size() >= frames; });
  }
  [[nodiscard]] bool run_until_state(BusState state) {
    return run_until([&] { return !states_.empty() && states_.back() == state; });
  }

  const std::string interface_ = "dbtest0";
  asio::io_context io_;
  std::unique_ptr<SocketCanBus> bus_;
  std::vector<Frame> heard_;
  std::vector<BusState> states_;
  std::int64_t last_stamp_ns_ = 0;
};

}  // namespace drivebench::can
