#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "clients/link/can_bus.hpp"
#include "protocols/can/codec.hpp"

namespace drivebench::link {

/// A bench with one axis behind a bus in memory. It does in lockstep what the native profile says, and loses
/// the frames that `loses` picks, in either direction.
class FakeCanBench final : public CanBus {
 public:
  FakeCanBench(const can::Profile& its_profile, std::uint32_t its_node)
      : profile(its_profile), node(its_node) {
    heartbeat();
  }

  void send(const can::Frame& frame) override {
    if (loses && loses(frame)) return;
    sent.push_back(frame);
    const can::Match match = can::match(profile, frame);
    if (!match.ok() || match.node != node) return;
    const can::Values values = can::decode(*match.row, profile, frame);
    if (match.row->message == can::Message::kRequest) on_request(values);
    if (match.row->message == can::Message::kCommand) on_command(*match.row, values);
  }

  std::optional<can::Frame> receive(Clock::time_point) override {
    if (coming.empty()) return std::nullopt;
    const can::Frame frame = coming.front();
    coming.pop_front();
    return frame;
  }

  /// The newest sample as frames, then SYNC.
  void put_sample() {
    put(can::Message::kEncoder);
    put(can::Message::kCurrents);
    put(can::Message::kSensors);
    if (sends_sync) put(can::Message::kSync, {static_cast<double>(sample.tick), lockstep ? 1.0 : 0.0});
  }
  void put_state() {
    put(can::Message::kState);
    put(can::Message::kCounters);
  }
  void put_reply(double request, double result, double controller, double number, double tick = 0.0) {
    put(can::Message::kReply, {request, result, controller, number, tick});
  }
  void heartbeat() { put(can::Message::kHeartbeat, {5.0, version, 0.0, lease, 125.0}); }
  void put(can::Message message, const std::vector<double>& values) {
    add(can::encode(*can::find_message(message, profile.fd), profile, node, values));
  }
  /// Nothing in a profile without this message.
  void put(can::Message message) {
    const can::MessageRow* const row = can::find_message(message, profile.fd);
    if (row != nullptr) add(can::encode_sample(*row, profile, node, sample));
  }
  void add(const can::Frame& frame) {
    if (!loses || !loses(frame)) coming.push_back(frame);
  }

  const can::Profile profile;
  const std::uint32_t node;
  std::deque<can::Frame> coming;  ///< to the controller
  std::vector<can::Frame> sent;   ///< by the controller, and not lost
  std::function<bool(const can::Frame&)> loses;
  Sample sample;
  std::int64_t counts_per_tick = 1;
  bool lockstep = true;
  bool sends_sync = true;
  double lease = 0.0;
  double version = can::kProfileVersion;
  double request_result = 0.0;  ///< other than 0: every request is refused
  double command_result = 0.0;  ///< other than 0: every command is refused
  std::vector<double> command;  ///< tick, u_a, u_b, mode of the last one taken

 private:
  static constexpr double kBadLease = 1.0;
  static constexpr double kStale = 5.0;

  void on_request(const can::Values& values) {
    const double request = values[0];
    if (request == 1.0 && request_result == 0.0) lease = 7;
    const double result = request_result != 0.0                  ? request_result
                          : request != 1.0 && values[1] != lease ? kBadLease
                                                                 : 0.0;
    put_reply(request, result, values[2], result == 0.0 ? lease : 0.0);
    if (result != 0.0) return;
    if (request == 3.0) lease = 0;
    put_state();
    if (request == 1.0) put_sample();
  }

  void on_command(const can::MessageRow& row, const can::Values& values) {
    const auto value = [&](std::string_view name) {
      return values[can::index_of(can::Message::kCommand, profile.fd, name)];
    };
    const unsigned bits = row.fields[can::index_of(can::Message::kCommand, profile.fd, "tick")].bits;
    const auto tick = static_cast<std::uint64_t>(
        can::unwrap(static_cast<std::uint64_t>(value("tick")), bits, static_cast<std::int64_t>(sample.tick)));
    double result = command_result;
    if (result == 0.0 && value("lease") != lease) result = kBadLease;
    if (result == 0.0 && tick != sample.tick) result = kStale;
    if (result != 0.0) return put_reply(0.0, result, 0.0, lease, static_cast<double>(tick));
    command = {static_cast<double>(tick), value("u_a"), value("u_b"), value("mode")};
    ++sample.tick;
    sample.encoder_count += counts_per_tick;
    put_sample();
  }
};

}  // namespace drivebench::link
