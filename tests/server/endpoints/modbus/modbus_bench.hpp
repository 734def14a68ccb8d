#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "boost/asio/post.hpp"
#include "server/endpoints/modbus/map_info.hpp"
#include "server/endpoints/modbus/modbus_server.hpp"
#include "server/host/asio.hpp"
#include "tests/server/recording/run_config.hpp"

/// A bench served over Modbus in this process, and a client that sends bytes as told.
namespace drivebench::modbus {

using Bytes = std::vector<std::uint8_t>;
using Words = std::vector<std::uint16_t>;
using Sizes = std::vector<std::size_t>;

inline void append_word(Bytes& bytes, std::size_t word) {
  bytes.push_back(static_cast<std::uint8_t>(word >> 8));
  bytes.push_back(static_cast<std::uint8_t>(word));
}
/// A function code and words.
inline Bytes pdu_of(std::uint8_t function, const std::vector<std::size_t>& words) {
  Bytes pdu{function};
  for (const std::size_t word : words)
    append_word(pdu, word);
  return pdu;
}
inline Bytes write_pdu(std::size_t address, const Words& words) {
  Bytes pdu = pdu_of(16, {address, words.size()});
  pdu.push_back(static_cast<std::uint8_t>(2 * words.size()));
  for (const std::uint16_t word : words)
    append_word(pdu, word);
  return pdu;
}
inline Bytes read_write_pdu(std::size_t read, std::size_t count, std::size_t write, const Words& words) {
  Bytes pdu = pdu_of(23, {read, count, write, words.size()});
  pdu.push_back(static_cast<std::uint8_t>(2 * words.size()));
  for (const std::uint16_t word : words)
    append_word(pdu, word);
  return pdu;
}
inline Bytes exception_pdu(std::uint8_t function, std::uint8_t code) {
  return {static_cast<std::uint8_t>(function | 0x80), code};
}
inline Bytes adu_of(std::uint16_t transaction, std::uint8_t unit, const Bytes& pdu) {
  Bytes adu;
  append_word(adu, transaction);
  append_word(adu, 0);
  append_word(adu, pdu.size() + 1);
  adu.push_back(unit);
  adu.insert(adu.end(), pdu.begin(), pdu.end());
  return adu;
}

/// Mode, counter and two floats, as the command block takes them from register 402 on.
inline Words command_words(std::uint16_t mode, std::uint32_t counter, float a, float b) {
  const auto high = [](std::uint32_t bits) { return static_cast<std::uint16_t>(bits >> 16); };
  const auto low = [](std::uint32_t bits) { return static_cast<std::uint16_t>(bits); };
  const auto bits_a = std::bit_cast<std::uint32_t>(a);
  const auto bits_b = std::bit_cast<std::uint32_t>(b);
  return {mode, high(counter), low(counter), high(bits_a), low(bits_a), high(bits_b), low(bits_b)};
}

/// The same with phase c and the field, from register 422 on.
inline Words command_words(std::uint16_t mode, std::uint32_t counter, std::array<float, 4> setpoints) {
  Words words = command_words(mode, counter, setpoints[0], setpoints[1]);
  const Words others = command_words(mode, counter, setpoints[2], setpoints[3]);
  words.insert(words.end(), others.begin() + 3, others.end());
  return words;
}

/// Registers of an axis of the servo bench at which a parameter stands.
inline std::size_t address_of(std::string_view parameter) {
  const std::vector<ParameterInfo> infos = parameter_infos(servo_axis());
  const auto found = std::find_if(infos.begin(), infos.end(),
                                  [&](const ParameterInfo& info) { return info.name == parameter; });
  EXPECT_NE(found, infos.end()) << parameter;
  return kParameterStart + 2 * static_cast<std::size_t>(found - infos.begin());
}

/// A blocking client. No answer for half a minute counts as a closed connection and fails the test.
class Client {
 public:
  explicit Client(std::uint16_t port, const char* from = "127.0.0.1")
      : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const timeval patience{.tv_sec = 30, .tv_usec = 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    const int on = 1;
    ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    ::inet_pton(AF_INET, from, &address.sin_addr);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    ::inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    address.sin_port = htons(port);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  }
  ~Client() { close(); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void close() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }
  /// False: the peer has ended the connection.
  bool send(const Bytes& bytes) {
    return ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
  }
  /// Up to this many bytes; fewer only if the connection has ended.
  Bytes receive(std::size_t count) {
    Bytes bytes(count);
    std::size_t got = 0;
    while (got < count) {
      const ssize_t n = ::recv(socket_, bytes.data() + got, count - got, 0);
      EXPECT_FALSE(n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) << "no answer";
      if (n <= 0) break;
      got += static_cast<std::size_t>(n);
    }
    bytes.resize(got);
    return bytes;
  }
  /// The next whole frame; empty at the end of the connection.
  Bytes receive_adu() {
    Bytes adu = receive(7);
    if (adu.size() < 7) return {};
    const Bytes rest = receive(static_cast<std::size_t>(adu[4] << 8 | adu[5]) - 1);
    adu.insert(adu.end(), rest.begin(), rest.end());
    return adu;
  }
  bool is_closed() { return receive(1).empty(); }

  /// The PDU that answers this one; empty if the connection was closed instead.
  Bytes ask(const Bytes& pdu, std::uint8_t unit = 1) {
    send(adu_of(++transaction_, unit, pdu));
    const Bytes adu = receive_adu();
    if (adu.empty()) return {};
    EXPECT_EQ(adu[0] << 8 | adu[1], transaction_);
    EXPECT_EQ(adu[2] << 8 | adu[3], 0);
    EXPECT_EQ(adu[6], unit);
    return {adu.begin() + 7, adu.end()};
  }
  /// Registers; empty after an exception.
  Words read(std::size_t address, std::size_t count, std::uint8_t unit = 1, std::uint8_t function = 3) {
    return words_in(ask(pdu_of(function, {address, count}), unit));
  }
  /// As many requests as it takes.
  Words read_all(std::size_t address, std::size_t count, std::uint8_t unit = 1) {
    Words all;
    for (std::size_t at = 0; at < count; at += 100) {
      const Words some = read(address + at, std::min<std::size_t>(count - at, 100), unit);
      EXPECT_FALSE(some.empty()) << address + at;
      all.insert(all.end(), some.begin(), some.end());
    }
    return all;
  }
  std::uint16_t read_one(std::size_t address, std::uint8_t unit = 1) {
    const Words words = read(address, 1, unit);
    return words.empty() ? std::uint16_t{0xdead} : words[0];
  }
  /// Exception code, 0 if there was none.
  int write(std::size_t address, const Words& words, std::uint8_t unit = 1) {
    return exception_in(ask(write_pdu(address, words), unit));
  }
  /// A command in one transaction with reading the sample: empty after an exception.
  Words exchange(std::uint16_t mode, std::uint32_t counter, float a, float b, std::uint8_t unit = 1) {
    last_ = ask(read_write_pdu(kSampleStart, kSampleLength, 402, command_words(mode, counter, a, b)), unit);
    return words_in(last_);
  }
  int last_exception() const { return exception_in(last_); }

  static int exception_in(const Bytes& pdu) {
    if (pdu.empty()) return -1;
    return (pdu[0] & 0x80) != 0 ? pdu.at(1) : 0;
  }
  static Words words_in(const Bytes& pdu) {
    Words words;
    if (exception_in(pdu) != 0) return words;
    for (std::size_t i = 2; i + 1 < pdu.size(); i += 2)
      words.push_back(static_cast<std::uint16_t>(pdu[i] << 8 | pdu[i + 1]));
    return words;
  }

 private:
  int socket_;
  std::uint16_t transaction_ = 0;
  Bytes last_;
};

inline BenchConfig modbus_bench_config(std::size_t axes = 1) {
  BenchConfig config = servo_bench(axes);
  config.modbus.enabled = true;
  config.modbus.port = 0;
  config.modbus.allow_writes = true;
  config.modbus.requests_per_s = 0;
  return config;
}

/// Trips at the first current that flows.
inline BenchConfig tripping_bench_config() {
  BenchConfig config = modbus_bench_config();
  config.setup.axes[0].parameters.drive.amplifier.over_current_a = 0.01;
  config.setup.axes[0].parameters.drive.amplifier.over_current_trip = true;
  return config;
}

/// A lockstep (or real-time) bench with its Modbus server on a thread of its own.
class ModbusBench {
 public:
  explicit ModbusBench(const BenchConfig& config = modbus_bench_config(), Audit* audit = nullptr)
      : server_(io_, config.modbus),
        engine_(config.mode == RunMode::kLockstep
                    ? make_lockstep_engine(config)
                    : make_threaded_engine(config, nullptr, io_, std::nullopt)) {
    if (audit != nullptr) audit->watch(*engine_);
    server_.serve(*engine_, audit);
    const std::string address = server_.address();
    port_ = static_cast<std::uint16_t>(std::stoul(address.substr(address.rfind(':') + 1)));
    thread_ = std::thread([this] { io_.run(); });
  }
  /// Runs something on the I/O thread, the only one that may look at the engine.
  template <class Function>
  auto on_io(Function function) {
    std::promise<decltype(function())> promise;
    asio::post(io_, [&] { promise.set_value(function()); });
    return promise.get_future().get();
  }
  ~ModbusBench() {
    on_io([this] {
      engine_->stop();
      server_.close();
      return 0;
    });
    io_.stop();
    thread_.join();
    engine_.reset();
  }

  std::uint16_t port() const { return port_; }
  Sample newest(std::size_t axis = 0) {
    return on_io([this, axis] { return engine_->newest(axis); });
  }
  Owner owner(std::size_t axis = 0) {
    return on_io([this, axis] { return engine_->owner(axis); });
  }
  Refused request(const Input& input) {
    std::promise<Refused> answer;
    asio::post(io_, [&] {
      engine_->request(input, [&answer](Refused refused, Tick) { answer.set_value(refused); });
    });
    return answer.get_future().get();
  }
  std::uint64_t count(std::string_view name) {
    const TransportReport report = on_io([this] { return server_.report(); });
    for (const auto& [key, value] : report.counts)
      if (key == name) return value;
    ADD_FAILURE() << "there is no count " << name;
    return 0;
  }
  /// Waits for something that happens by itself.
  template <class Condition>
  void until(Condition condition) {
    for (int i = 0; i < 30'000 && !condition(); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_TRUE(condition()) << "never";
  }

 private:
  asio::io_context io_{1};
  ModbusServer server_;
  std::unique_ptr<Engine> engine_;
  std::uint16_t port_ = 0;
  std::thread thread_;
};

}  // namespace drivebench::modbus
