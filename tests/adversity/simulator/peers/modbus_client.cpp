#include "tests/adversity/simulator/peers/modbus_client.hpp"

#include <algorithm>
#include <bit>

namespace drivebench::simulator {
namespace {

constexpr std::size_t kMbapSize = 7;
constexpr std::size_t kLeaseKey = 400;
constexpr std::size_t kRequest = 401;
constexpr std::size_t kCommandMode = 402;
constexpr Time kLookedAfter = 500 * kMillisecond;     // frame_timeout_ms
constexpr Time kConnectionIdle = 500 * kMillisecond;  // idle_timeout_ms of draw_bench()
constexpr std::uint16_t kClear = 1;
constexpr std::uint16_t kRelease = 2;

void append(std::string& bytes, std::size_t word) {
  bytes.push_back(static_cast<char>(word >> 8));
  bytes.push_back(static_cast<char>(word));
}

}  // namespace

ModbusClient::ModbusClient(Scene& scene, std::uint64_t number, std::function<int()> connect)
    : scene_(scene),
      number_(number),
      random_(scene.random.fork()),
      connect_(std::move(connect)),
      axis_(static_cast<std::uint32_t>(random_.below(scene.axes.size()))) {}

void ModbusClient::take_turn() {
  if (scene_.ending) return;
  scene_.schedule.after(random_.between(1, 12) * kMillisecond, [this] { take_turn(); });
  const bool is_quiet = scene_.schedule.now() < quiet_until_;
  // The server checks a client that waits for its tick twice a second, and its key keeps the lease.
  if (!is_quiet || may_be_heard()) {
    const Time keeps = kLookedAfter + std::max(scene_.lease(), kConnectionIdle) + Scene::kSlack;
    scene_.axes[axis_].may_keep("modbus", scene_.awake() + keeps);
  }
  if (is_quiet) return;
  if (wire_ && wire_->is_open()) return act();
  scene_.note("modbus connects", number_);
  ++connection_;
  asked_.clear();
  received_.clear();
  raw_ = false;
  wire_ = std::make_shared<Wire>(
      scene_.schedule, random_.fork(),
      Quality{.delay = kMillisecond, .jitter = random_.between(0, 5) * kMillisecond, .torn = 0.3},
      connect_());
  read();
}

/// A client that sends nothing keeps it too: bytes are on their way, or it waits for a tick that others
/// delay.
bool ModbusClient::may_be_heard() const {
  const bool lockstep = scene_.engine->config().mode == RunMode::kLockstep;
  return wire_ && wire_->is_open() && (wire_->has_under_way() || (lockstep && !asked_.empty()));
}

void ModbusClient::act() {
  if (random_.chance(0.003)) {
    quiet_until_ = scene_.schedule.now() + random_.between(100, 5000) * kMillisecond;
    scene_.note("modbus falls silent", number_, static_cast<std::uint64_t>(quiet_until_));
    return random_.chance(0.5) ? leave() : void();
  }
  if (asked_.size() > 8) return;
  const std::uint64_t what = random_.below(1000);
  if (what < 5) return leave();
  if (what < 10) return wire_->stop_until(scene_.schedule.now() + random_.between(1, 1500) * kMillisecond);
  if (what < 15) {
    raw_ = true;
    std::string bytes(1 + random_.below(40), '\0');
    for (char& byte : bytes)
      byte = static_cast<char>(random_.below(256));
    scene_.axes[axis_].command_sent();
    return wire_->send(bytes);
  }
  if (what < 60) return write(kLeaseKey, {4711});
  if (what < 80) return write(kRequest, {kClear});
  if (what < 90) return write(kRequest, {kRelease});
  if (what < 100) return write(random_.below(1200), Words(1 + random_.below(6), 1));
  if (what < 250) return ask(random_.chance(0.5) ? 3 : 4, {random_.below(300), 1 + random_.below(100)});
  if (what < 260) return ask(static_cast<std::uint8_t>(random_.below(128)), {random_.below(500), 1});
  const Words words = command();
  if (what < 600) return write(kCommandMode, words);
  ask(23, {200, 60, kCommandMode, words.size()}, words);
}

ModbusClient::Words ModbusClient::command() {
  const auto tick = static_cast<std::uint32_t>(scene_.engine->tick() - random_.between(0, 2));
  const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(random_.real(-5.0, 5.0)));
  const auto high = static_cast<std::uint16_t>(bits >> 16);
  const auto low = static_cast<std::uint16_t>(bits);
  const std::uint16_t mode =
      random_.chance(0.1) ? static_cast<std::uint16_t>(random_.below(6)) : std::uint16_t{1};
  return {mode, static_cast<std::uint16_t>(tick >> 16), static_cast<std::uint16_t>(tick), high, low, high,
          low};
}

/// A function code, words, and for a write their size and the data.
void ModbusClient::ask(std::uint8_t function, std::initializer_list<std::size_t> words, const Words& data) {
  std::string pdu(1, static_cast<char>(function));
  for (const std::size_t word : words)
    append(pdu, word);
  if (!data.empty()) {
    pdu.push_back(static_cast<char>(2 * data.size()));
    scene_.axes[axis_].command_sent();
    scene_.axes[axis_].clear_unanswered();
  }
  for (const std::uint16_t word : data)
    append(pdu, word);
  std::string adu;
  append(adu, ++transaction_);
  append(adu, 0);
  append(adu, pdu.size() + 1);
  adu.push_back(static_cast<char>(axis_ + 1));
  asked_.push_back(transaction_);
  scene_.note("modbus asks", number_, function, transaction_);
  wire_->send(adu + pdu);
}

void ModbusClient::read() {
  const std::span<const std::byte> bytes = wire_->receive(4096);
  on_bytes(bytes);
  if (!wire_->is_open()) return scene_.note("modbus is cut off", number_);
  scene_.schedule.after(2 * kMillisecond, [this, connection = connection_] {
    if (connection == connection_ && wire_->is_open()) read();
  });
}

void ModbusClient::on_bytes(std::span<const std::byte> bytes) {
  for (const std::byte byte : bytes)
    received_.push_back(static_cast<std::uint8_t>(byte));
  while (received_.size() >= kMbapSize) {
    const std::size_t length = kMbapSize - 1 + static_cast<std::size_t>(received_[4] << 8 | received_[5]);
    scene_.require(length > kMbapSize && length <= 260, "an answer of Modbus has a length");
    if (received_.size() < length) return;
    const auto transaction = static_cast<std::uint16_t>(received_[0] << 8 | received_[1]);
    received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(length));
    scene_.note("modbus hears", number_, transaction);
    if (raw_) continue;
    scene_.require(!asked_.empty() && asked_.front() == transaction, "Modbus answers each request, in order");
    if (!asked_.empty()) asked_.pop_front();
  }
}

void ModbusClient::finish() {
  if (!wire_ || !wire_->is_open()) return;
  wire_->heal();
  if (!raw_ && random_.chance(0.5)) write(kRequest, {kRelease});
}

void ModbusClient::check_end() {
  if (!wire_ || !wire_->is_open() || raw_) return;
  const bool waits = scene_.engine->config().mode == RunMode::kLockstep;  // for the other axes
  scene_.require(asked_.empty() || waits, "every Modbus request has an answer");
}

void ModbusClient::leave() {
  if (!wire_ || !wire_->is_open()) return;
  scene_.note("modbus leaves", number_);
  wire_->cut();
  asked_.clear();
}

}  // namespace drivebench::simulator
