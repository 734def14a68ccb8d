#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/link/tcp/tcp_link.hpp"
#include "protocols/sample_codec.hpp"
#include "tests/benchmark/harness/server.hpp"

namespace drivebench::speed {

/// Exchanges in a block, whose percentiles are one result.
inline constexpr std::size_t kBlock = 2000;

struct Sizes {
  std::size_t request = 0;  ///< bytes on the wire, header included
  std::size_t reply = 0;
};

/// The controller's side of a lockstep run: the servo after a line start, so that no signal is zero and
/// short.
class Controller {
 public:
  explicit Controller(const std::string& address) : link_(address) {
    link_.acquire(0);
    tick_ = link_.exchange({}).front().sample.tick;
    for (int k = 0; k < kStartTicks; ++k)
      exchange();
  }

  void exchange() {
    const TwoPhase& u = line_voltages()[tick_ % line_voltages().size()];
    command_ = {.axis = 0, .tick = tick_, .gates = v1::GATES_VOLTAGE, .u_a_v = u.a, .u_b_v = u.b};
    const Sample& sample = link_.exchange({&command_, 1}).front().sample;
    if (sample.tick != tick_ + 1) throw std::runtime_error("an exchange did not run exactly one tick");
    tick_ = sample.tick;
  }

  Sizes sizes() {
    const TwoPhase& u = line_voltages()[tick_ % line_voltages().size()];
    v1::Envelope request;
    request.set_id(tick_);
    v1::Command& command = *request.mutable_exchange()->add_commands();
    command.set_tick(tick_);
    command.set_gates(v1::GATES_VOLTAGE);
    command.set_u_a_v(u.a);
    command.set_u_b_v(u.b);
    const link::AxisSample& newest = link_.exchange({}).front();
    const AxisSampleView view{static_cast<std::uint32_t>(newest.axis), &newest.sample};
    std::vector<std::byte> reply;
    append_exchange_reply(reply, tick_, {&view, 1});
    return {.request = kFrameHeaderSize + request.ByteSizeLong(), .reply = reply.size()};
  }

 private:
  static constexpr int kStartTicks = 4000;

  link::Link link_;
  link::AxisCommand command_{};
  std::uint64_t tick_ = 0;
};

}  // namespace drivebench::speed
