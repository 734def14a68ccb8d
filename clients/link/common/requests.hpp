#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <stdexcept>
#include <string>

#include "protocols/signals/edge_record.hpp"

/// The requests of a client over any link, and the refusal of the bench.
namespace drivebench::link {

/// The bench refused a request; the link goes on. what() is the bench's sentence.
class RefusalError : public std::runtime_error {
 public:
  explicit RefusalError(const v1::Refusal& refusal)
      : std::runtime_error(refusal.message()), code_(refusal.code()), field_(refusal.field()) {}

  v1::RefusalCode code() const noexcept { return code_; }
  const std::string& field() const noexcept { return field_; }  ///< the refused field; may be empty

 private:
  v1::RefusalCode code_;
  std::string field_;
};

/// A command for an axis, in answer to the sample of `tick`: voltages, currents with GATES_CURRENT, or duties
/// with GATES_DUTY, as bench.proto defines them. A machine ignores terminals that it lacks; `f` is the field
/// winding.
struct AxisCommand {
  std::uint32_t axis = 0;
  std::uint64_t tick = 0;
  v1::Gates gates = v1::GATES_OFF;
  double u_a_v = 0.0;
  double u_b_v = 0.0;
  double u_c_v = 0.0;
  double u_f_v = 0.0;
  double i_a_a = 0.0;
  double i_b_a = 0.0;
  double i_c_a = 0.0;
  double i_f_a = 0.0;
  double d_a = 0.0;
  double d_b = 0.0;
  double d_c = 0.0;
  double d_f = 0.0;
  std::uint32_t legs_off = 0;  ///< legs that are off: 1 a, 2 b, 4 c
  EdgeRecords edges{};         ///< with GATES_EDGES, of which the field has the duty d_f
};

/// The set-points of a command by its gates.
struct Setpoints {
  double a = 0.0;
  double b = 0.0;
  double c = 0.0;
  double f = 0.0;
};

constexpr Setpoints setpoints_of(const AxisCommand& x) noexcept {
  if (x.gates == v1::GATES_CURRENT) return {x.i_a_a, x.i_b_a, x.i_c_a, x.i_f_a};
  if (x.gates == v1::GATES_DUTY || x.gates == v1::GATES_EDGES) return {x.d_a, x.d_b, x.d_c, x.d_f};
  return {x.u_a_v, x.u_b_v, x.u_c_v, x.u_f_v};
}

inline Setpoints setpoints_of(const v1::Command& x) {
  if (x.gates() == v1::GATES_CURRENT) return {x.i_a_a(), x.i_b_a(), x.i_c_a(), x.i_f_a()};
  if (x.gates() == v1::GATES_DUTY || x.gates() == v1::GATES_EDGES)
    return {x.d_a(), x.d_b(), x.d_c(), x.d_f()};
  return {x.u_a_v(), x.u_b_v(), x.u_c_v(), x.u_f_v()};
}

struct LoadChange {
  double load_nm = 0.0;
  std::uint64_t ramp_ticks = 0;  ///< 0: a step
  std::uint64_t at_tick = 0;     ///< 0: as soon as possible
};

/// A new value of a parameter.
struct ParameterChange {
  std::string name{};
  double value = 0.0;
  std::uint64_t ramp_ticks = 0;  ///< 0: a step
  std::uint64_t at_tick = 0;     ///< 0: as soon as possible
};

/// An injected fault; a value of 0 ends it.
struct FaultInjection {
  std::string name{};
  double value = 0.0;
  std::uint64_t at_tick = 0;  ///< 0: as soon as possible
};

}  // namespace drivebench::link
