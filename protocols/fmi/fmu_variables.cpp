#include "protocols/fmi/fmu_variables.hpp"

#include <array>
#include <cctype>
#include <cstdio>
#include <limits>
#include <utility>

namespace drivebench::fmi {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

Type type_of(const drivebench_signal& signal) noexcept {
  if (signal.type == DRIVEBENCH_TYPE_UNSIGNED) return Type::kUInt64;
  return signal.type == DRIVEBENCH_TYPE_SIGNED ? Type::kInt64 : Type::kReal;
}

/// Lists the variables of one axis.
class AxisVariables {
 public:
  AxisVariables(const drivebench_description& bench, std::uint32_t axis, std::vector<Variable>& all)
      : bench_(bench), axis_(bench.axes[axis]), number_(axis), all_(all) {
    if (bench.axis_count > 1) prefix_ = std::string(axis_.name) + ".";
  }

  void add_commands() {
    const std::uint32_t gates = usual_gates(axis_);
    if (gates != DRIVEBENCH_GATES_OFF) {
      add_setpoints(gates);
      add_input("gates", "", "state of the gates: 0 off, 1 voltages, 2 zero voltage, 3 currents, 4 duties",
                Type::kInt32, gates, DRIVEBENCH_GATES_DUTY, Purpose::kGates);
      add_input("legs_off", "", "legs that are off whatever the gates: 1 a, 2 b, 4 c", Type::kInt32, 0.0, 7.0,
                Purpose::kLegsOff);
    }
    add_input("clear", "", "a change from 0 to 1 clears the latched faults", Type::kInt32, 0.0, 1.0,
              Purpose::kClear);
  }

  void add_load() {
    add({.name = "load_torque_nm",
         .unit = "N*m",
         .meaning = "load torque; positive opposes positive torque",
         .causality = Causality::kInput,
         .type = Type::kReal,
         .start = 0.0,
         .minimum = -kNoLimit,
         .maximum = kNoLimit,
         .purpose = Purpose::kLoad,
         .axis = number_,
         .row = 0});
  }

  void add_parameters() {
    for (std::size_t row = 0; row < axis_.parameter_count; ++row) {
      const drivebench_parameter& p = axis_.parameters[row];
      if (p.live != 0) add_parameter(p, p.name, p.value, Purpose::kParameter, row);
    }
    for (std::size_t row = 0; row < bench_.injectable_count; ++row) {
      const drivebench_injectable& f = bench_.injectables[row];
      add_parameter(f, std::string("fault.") + f.name, 0.0, Purpose::kFault, row);
    }
  }

  void add_signals() {
    for (std::size_t row = 0; row < bench_.signal_count; ++row) {
      const drivebench_signal& s = bench_.signals[row];
      add({.name = s.name,
           .unit = s.unit,
           .meaning = s.meaning,
           .causality = Causality::kOutput,
           .type = type_of(s),
           .start = 0.0,
           .minimum = -kNoLimit,
           .maximum = kNoLimit,
           .purpose = Purpose::kSignal,
           .axis = number_,
           .row = row});
    }
  }

 private:
  void add(Variable variable) {
    variable.name = prefix_ + variable.name;
    all_.push_back(std::move(variable));
  }

  void add_input(const char* name, const char* unit, const char* meaning, Type type, double start,
                 double maximum, Purpose purpose) {
    add({.name = name,
         .unit = unit,
         .meaning = meaning,
         .causality = Causality::kInput,
         .type = type,
         .start = start,
         .minimum = 0.0,
         .maximum = maximum,
         .purpose = purpose,
         .axis = number_,
         .row = 0});
  }

  void add_setpoints(std::uint32_t gates) {
    constexpr std::array<const char*, 4> kNames{"setpoint_a", "setpoint_b", "setpoint_c", "setpoint_f"};
    for (std::size_t row = 0; row < kNames.size(); ++row) {
      const bool is_there = row < 3 ? row < axis_.phases : axis_.field_winding != 0;
      if (!is_there) continue;
      add({.name = kNames[row],
           .unit = gates == DRIVEBENCH_GATES_CURRENT ? "A" : "V",
           .meaning = std::string(row < 3 ? "set-point of a terminal" : "set-point of the field winding") +
                      ", a voltage, a current or a duty as the gates say",
           .causality = Causality::kInput,
           .type = Type::kReal,
           .start = 0.0,
           .minimum = -kNoLimit,
           .maximum = kNoLimit,
           .purpose = Purpose::kSetpoint,
           .axis = number_,
           .row = row});
    }
  }

  template <class Row>
  void add_parameter(const Row& p, std::string name, double start, Purpose purpose, std::size_t row) {
    add({.name = std::move(name),
         .unit = p.unit,
         .meaning = p.meaning,
         .causality = Causality::kParameter,
         .type = Type::kReal,
         .start = start,
         .minimum = p.minimum,
         .maximum = p.maximum,
         .purpose = purpose,
         .axis = number_,
         .row = row});
  }

  const drivebench_description& bench_;
  const drivebench_axis& axis_;
  std::uint32_t number_;
  std::vector<Variable>& all_;
  std::string prefix_;
};

}  // namespace

std::vector<Variable> variables_of(const drivebench_description& bench, const IsCommanded& is_commanded) {
  std::vector<Variable> all;
  for (std::uint32_t axis = 0; axis < bench.axis_count; ++axis) {
    AxisVariables variables(bench, axis, all);
    if (is_commanded[axis]) variables.add_commands();
    variables.add_load();
    variables.add_parameters();
    variables.add_signals();
  }
  return all;
}

std::uint32_t usual_gates(const drivebench_axis& axis) noexcept {
  const std::string_view kind = axis.drive_kind;
  if (kind == "source") return DRIVEBENCH_GATES_OFF;
  return kind == "current_amplifier" ? DRIVEBENCH_GATES_CURRENT : DRIVEBENCH_GATES_VOLTAGE;
}

std::string token_of(const drivebench_description& bench) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "{drivebench-%016llx}",
                static_cast<unsigned long long>(bench.configuration_hash));
  return text.data();
}

std::string identifier_of(std::string_view name) {
  std::string result;
  for (const char c : name)
    result += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  const bool starts_well = !result.empty() && std::isalpha(static_cast<unsigned char>(result[0])) != 0;
  return starts_well ? result : "bench_" + result;
}

}  // namespace drivebench::fmi
