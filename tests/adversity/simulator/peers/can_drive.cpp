#include "tests/adversity/simulator/peers/can_drive.hpp"

#include <algorithm>
#include <array>

#include "plant/faults.hpp"
#include "protocols/can/command.hpp"
#include "server/bench/terminals.hpp"

namespace drivebench::simulator {
namespace {

constexpr std::uint32_t kController = 77;
constexpr double kStopped = 4.0;
constexpr double kOperational = 5.0;
constexpr Time kTurn = 10 * kMillisecond;
constexpr Time kHeartbeatLimit = 200 * kMillisecond;  // controller_timeout_ms of draw_bench()
constexpr Time kIdle = 500 * kMillisecond;            // idle_timeout_ms

}  // namespace

CanDrive::CanDrive(Scene& scene, can::MemoryWire& wire, const can::Profile& profile, std::uint32_t axis)
    : scene_(scene),
      random_(scene.random.fork()),
      wire_(wire),
      profile_(profile),
      bus_(wire.connect("board")),
      axis_(axis),
      node_(scene.engine->config().axes[axis].can_node),
      wide_(terminals_of(scene.engine->parameters(axis)).is_wide()),
      commands_(random_.real(0.3, 1.0)) {
  for (std::uint32_t i = 0; i < scene.axes.size(); ++i)
    profile_.wide |= terminals_of(scene.engine->parameters(i)).is_wide();
  bus_->on_frame = [this](const can::Frame& frame, std::int64_t) { on_frame(frame); };
}

void CanDrive::take_turn() {
  if (scene_.ending) return;
  scene_.schedule.after(kTurn, [this] { take_turn(); });
  const Time now = scene_.schedule.now();
  // In lockstep a controller that has commanded the tick may be silent until the others have, unless it sends
  // heartbeats.
  const bool waits =
      scene_.engine->config().mode == RunMode::kLockstep && commanded_ == scene_.engine->tick();
  if (waits && !is_monitored()) keep();
  if (now < dead_until_) return;
  if (random_.chance(0.002)) {
    dead_until_ = now + random_.between(100, 4000) * kMillisecond;
    return scene_.note("board dies", axis_, static_cast<std::uint64_t>(dead_until_));
  }
  if (now >= sick_until_) heartbeat(kOperational);
  if (random_.chance(0.003)) sick_until_ = now + random_.between(100, 3000) * kMillisecond;
  if (lease_ == 0 && random_.chance(0.3)) return request(can::Request::kAcquire);
  if (latched_ && random_.chance(0.5)) return request(can::Request::kClearFaults);
  if (random_.chance(0.005)) return request(can::Request::kRelease);
  if (random_.chance(0.02)) return request(can::Request::kRenew);
  if (random_.chance(0.02)) disturb();
}

void CanDrive::disturb() {
  const std::uint64_t what = random_.below(6);
  const Time length = random_.between(1, 100) * kMillisecond;
  scene_.note("bus is disturbed", axis_, what);
  heartbeats_ = 0;
  switch (what) {
    case 0:
      return wire_.lose(1 + random_.below(kMostLost));
    case 1:
      wire_.set_full(true);
      return scene_.schedule.after(length, [this] { wire_.set_full(false); });
    case 2:
      wire_.set_link(can::BusState::kDown);
      return scene_.schedule.after(length, [this] { wire_.set_link(can::BusState::kUp); });
    case 3: {
      can::Frame error{};
      error.size = 8;
      error.id = static_cast<std::uint32_t>(random_.below(0x200));
      error.data[1] = static_cast<std::uint8_t>(random_.below(64));
      wire_.report(error);
      return scene_.schedule.after(length, [this] { wire_.set_link(can::BusState::kUp); });
    }
    case 4: {
      can::Frame noise{};  // of a CANopen device: never an identifier of the bench
      noise.id = 0x080 + static_cast<std::uint32_t>(random_.below(0x600));
      noise.size = static_cast<std::uint8_t>(random_.below(9));
      for (std::uint8_t& byte : noise.data)
        byte = static_cast<std::uint8_t>(random_.below(256));
      return bus_->send(noise);
    }
    default:
      return heartbeat(static_cast<double>(random_.below(256)));
  }
}

void CanDrive::on_frame(const can::Frame& frame) {
  const can::Match found = can::match(profile_, frame);
  scene_.require(found.ok(), "every frame of the bench is a message");
  if (!found.ok() || (found.row->per_node && found.node != node_)) return;
  const can::Values values = can::decode(*found.row, profile_, frame);
  const auto field = [&](std::string_view name) { return values[can::index_of(*found.row, name)]; };
  if (found.row->message == can::Message::kReply) return on_reply(*found.row, values);
  if (found.row->message == can::Message::kFault)
    latched_ = (static_cast<std::uint64_t>(field("faults")) & kLatchedFaults) != 0;
  if (found.row->message == can::Message::kHeartbeat && static_cast<unsigned>(field("lease")) != lease_)
    lease_ = 0;
  const bool is_dead = scene_.ending || scene_.schedule.now() < dead_until_;
  if (found.row->message == can::Message::kSync && lease_ != 0 && !is_dead && random_.chance(commands_))
    command(static_cast<std::uint64_t>(field("tick")));
}

void CanDrive::on_reply(const can::MessageRow& row, const can::Values& values) {
  const auto field = [&](std::string_view name) { return values[can::index_of(row, name)]; };
  const auto request = static_cast<can::Request>(field("request"));
  scene_.note("board hears a reply", axis_, static_cast<std::uint64_t>(field("request")),
              static_cast<std::uint64_t>(field("result")));
  answered_ = true;
  const bool done = field("result") == 0.0;
  if (request == can::Request::kAcquire && done) {
    lease_ = static_cast<std::uint8_t>(field("lease"));
    scene_.require(lease_ != 0, "a lease on the bus has a number");
    heartbeats_ = 0;
  }
  if (request == can::Request::kRelease && done) lease_ = 0;
  if (request == can::Request::kClearFaults && done) latched_ = false;
  if (static_cast<can::Result>(field("result")) == can::Result::kNotOwner) lease_ = 0;
  if (static_cast<can::Result>(field("result")) == can::Result::kLatched) latched_ = true;
}

void CanDrive::command(std::uint64_t tick) {
  const auto send_one = [this](std::uint64_t answers) {
    const can::CommandFrames frames = can::encode_command(
        profile_, node_, wide_,
        {.tick = answers,
         .mode = latched_ ? 0u : static_cast<unsigned>(random_.chance(0.02) ? random_.below(6) : 1),
         .lease = random_.chance(0.01) ? static_cast<unsigned>(random_.below(256)) : lease_,
         .a = random_.real(-10.0, 10.0),
         .b = random_.real(-10.0, 10.0)});
    scene_.axes[axis_].command_sent();
    commanded_ = scene_.engine->tick();
    keep();
    for (const can::Frame& frame : frames)
      if (!random_.chance(0.01)) bus_->send(frame);
  };
  send_one(random_.chance(0.03) ? tick + random_.below(10) - 5 : tick);
  if (random_.chance(0.02)) send_one(tick);
}

void CanDrive::request(can::Request request) {
  if (request == can::Request::kClearFaults) scene_.axes[axis_].clear_unanswered();
  const bool acquire = request == can::Request::kAcquire;
  send(can::Message::kRequest,
       std::array{static_cast<double>(request), acquire ? 0.0 : static_cast<double>(lease_),
                  static_cast<double>(kController)});
}

/// A controller with heartbeats loses the lease soon after the last of them.
void CanDrive::keep() {
  const Time keeps = is_monitored() ? kHeartbeatLimit : std::max(scene_.lease(), kIdle);
  scene_.axes[axis_].may_keep("can", scene_.awake() + keeps + Scene::kSlack);
}

void CanDrive::heartbeat(double state) {
  ++heartbeats_;
  send(can::Message::kControllerHeartbeat, std::array{state});
}

void CanDrive::send(can::Message message, std::span<const double> values) {
  scene_.note("board sends", axis_, static_cast<std::uint64_t>(message));
  keep();
  bus_->send(can::encode(*can::find_message(message, profile_.fd, wide_), profile_, node_, values));
}

void CanDrive::finish() {
  wire_.set_full(false);
  wire_.set_link(can::BusState::kUp);
  answered_ = false;
  scene_.schedule.after(200 * kMillisecond, [this] {  // earlier disturbances are over then
    wire_.set_link(can::BusState::kUp);
    send(can::Message::kRequest, std::array{static_cast<double>(can::Request::kRenew), 0.0, 0.0});
  });
}

void CanDrive::check_end() {
  scene_.require(answered_, "a request on the bus has a reply");
}

void CanDrive::leave() {
  heartbeat(kStopped);
}

}  // namespace drivebench::simulator
