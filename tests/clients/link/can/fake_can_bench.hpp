#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "clients/link/can/can_bus.hpp"
#include "protocols/can/command.hpp"

namespace drivebench::link {

inline constexpr std::uint32_t kNode = 3;

/// A bench with one axis behind a bus in memory. It does in lockstep what the native profile says, and loses
/// the frames that `loses` picks, in either direction.
class FakeCanBench final : public CanBus {
 public:
  /// Its axis is wide if the profile is.
  FakeCanBench(const can::Profile& its_profile, std::uint32_t its_node)
      : profile(its_profile), node(its_node), version(can::version_of(its_profile.id_set, its_profile.wide)) {
    heartbeat();
  }

  void send(const can::Frame& frame) override {
    if (loses && loses(frame)) return;
    sent.push_back(frame);
    const can::Match match = can::match(profile, frame);
    if (!match.ok() || match.node != node) return;
    const can::Values values = can::decode(*match.row, profile, frame);
    if (match.row->message == can::Message::kRequest) on_request(values);
    if (match.row->message == can::Message::kPhaseCommand) phases = can::setpoints_in(*match.row, values);
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
    if (!profile.fd) put(can::Message::kDetails, can::Page::kSpeedSensors);
    put(can::Message::kPhases);
    put(can::Message::kCurrents);
    put(can::Message::kSensors);
    if (sends_sync) put(can::Message::kSync, {static_cast<double>(sample.tick), lockstep ? 1.0 : 0.0});
  }
  void put_state() {
    put(can::Message::kState);
    put(can::Message::kCounters);
    put(can::Message::kDetails);
    if (!profile.fd) put(can::Message::kDetails, can::Page::kInjected);
  }
  void put_reply(double request, double result, double controller, double number, double tick = 0.0) {
    put(can::Message::kReply, {request, result, controller, number, tick});
  }
  void heartbeat() { put(can::Message::kHeartbeat, {5.0, version, 0.0, lease, 125.0}); }
  void put(can::Message message, const std::vector<double>& values) {
    add(can::encode(*can::find_message(message, profile.fd, profile.wide), profile, node, values));
  }
  /// Nothing in a profile without this message.
  void put(can::Message message, can::Page page = {}) {
    const can::MessageRow* const row = can::find_message(message, profile.fd, profile.wide);
    if (row != nullptr) add(can::encode_sample(*row, profile, node, sample, page));
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
  double version;
  double request_result = 0.0;  ///< other than 0: every request is refused
  double command_result = 0.0;  ///< other than 0: every command is refused
  std::vector<double> command;  ///< tick, u_a, u_b, mode of the last one taken; of a wide axis also u_c, u_f
  double legs_off = 0.0;        ///< of the same
  can::CommandFields phases{};  ///< of the last phase command

 private:
  static constexpr double kBadLease = 1.0;
  static constexpr double kStale = 5.0;
  static constexpr double kIncomplete = 8.0;

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
    can::CommandFields given = can::setpoints_in(row, values);
    legs_off = given.legs_off;
    const unsigned bits = row.fields[can::index_of(row, "tick")].bits;
    const auto tick =
        static_cast<std::uint64_t>(can::unwrap(given.tick, bits, static_cast<std::int64_t>(sample.tick)));
    const bool comes_in_two = profile.wide && !profile.fd && (given.mode == 1 || given.mode >= 3);
    const bool is_whole = !comes_in_two || (phases.tick == given.tick && phases.mode == given.mode &&
                                            phases.lease == given.lease);
    if (comes_in_two) {
      given.c = phases.c;
      given.field = phases.field;
    }
    double result = command_result;
    if (result == 0.0 && given.lease != lease) result = kBadLease;
    if (result == 0.0 && tick != sample.tick) result = kStale;
    if (result == 0.0 && !is_whole) result = kIncomplete;
    if (result != 0.0) return put_reply(0.0, result, 0.0, lease, static_cast<double>(tick));
    command = {static_cast<double>(tick), given.a, given.b, static_cast<double>(given.mode)};
    if (profile.wide) command.insert(command.end(), {given.c, given.field});
    ++sample.tick;
    sample.encoder_count += counts_per_tick;
    sample.i_c_a = static_cast<double>(sample.tick % 100);
    put_sample();
  }
};

}  // namespace drivebench::link
