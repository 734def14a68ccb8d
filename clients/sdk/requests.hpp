#pragma once

#include <algorithm>
#include <cstdint>
#include <exception>

#include "clients/link/common/requests.hpp"
#include "clients/link/tcp/tcp_link.hpp"
#include "protocols/abi/backend.hpp"
#include "protocols/abi/edges.hpp"

namespace drivebench::sdk {

/// Does a request over a link, and turns what it throws into a code and a sentence.
template <class Request>
int carry_out(abi::Backend& backend, Request request) noexcept {
  try {
    request();
    return DRIVEBENCH_OK;
  } catch (const link::RefusalError& refusal) {
    return backend.fail(static_cast<int>(refusal.code()), refusal.what(), refusal.field());
  } catch (const link::LinkError& lost) {
    return backend.fail(DRIVEBENCH_LINK_LOST, lost.what());
  } catch (const std::exception& failure) {
    return backend.fail(DRIVEBENCH_FAILED, failure.what());
  }
}

/// The command for a link.
inline link::AxisCommand command_for(const drivebench_command& c) noexcept {
  constexpr std::uint64_t kMost = 0xFFFF;  // no mask of legs, so that the bench refuses it
  link::AxisCommand to{.axis = c.axis,
                       .tick = c.tick,
                       .gates = static_cast<v1::Gates>(c.gates),
                       .legs_off = static_cast<std::uint32_t>(std::min(c.legs_off, kMost))};
  if (c.gates == DRIVEBENCH_GATES_CURRENT) {
    to.i_a_a = c.setpoint_a;
    to.i_b_a = c.setpoint_b;
    to.i_c_a = c.setpoint_c;
    to.i_f_a = c.setpoint_f;
  } else if (c.gates == DRIVEBENCH_GATES_EDGES) {
    to.d_f = c.setpoint_f;
    to.edges = abi::edges_of(c);
  } else if (c.gates == DRIVEBENCH_GATES_DUTY) {
    to.d_a = c.setpoint_a;
    to.d_b = c.setpoint_b;
    to.d_c = c.setpoint_c;
    to.d_f = c.setpoint_f;
  } else {
    to.u_a_v = c.setpoint_a;
    to.u_b_v = c.setpoint_b;
    to.u_c_v = c.setpoint_c;
    to.u_f_v = c.setpoint_f;
  }
  return to;
}

}  // namespace drivebench::sdk
