#include "server/fmu/fmu_instance.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "protocols/text.hpp"

namespace drivebench {
namespace {

using fmi::Purpose;

/// The place of a time between two ticks that is taken for the tick.
constexpr double kSameTick = 1e-6;

/// Puts an input into the command of its axis; does nothing with what is no part of a command.
void put(const fmi::Variable& variable, double value, drivebench_command& command) noexcept {
  const std::array<double*, 4> setpoints{&command.setpoint_a, &command.setpoint_b, &command.setpoint_c,
                                         &command.setpoint_f};
  if (variable.purpose == Purpose::kSetpoint) *setpoints[variable.row] = value;
  if (variable.purpose == Purpose::kGates) command.gates = static_cast<std::uint32_t>(value);
  if (variable.purpose == Purpose::kLegsOff) command.legs_off = static_cast<std::uint64_t>(value);
}

}  // namespace

FmuInstance::FmuInstance(const std::filesystem::path& bench_file)
    : bench_(load_inproc_config(bench_file)), is_commanded_(bench_.describe().axis_count, false) {
  const drivebench_description& bench = bench_.describe();
  if (acquire_all() != DRIVEBENCH_OK) throw std::runtime_error(error_);
  variables_ = fmi::variables_of(bench, is_commanded_);
  take_start_values();
  for (const drivebench_fault& fault : std::span(bench.faults, bench.fault_count))
    latched_ |= fault.latched != 0 ? fault.bit : 0;
}

int FmuInstance::fail(int code, std::string sentence) {
  error_ = std::move(sentence);
  return code;
}

int FmuInstance::checked(int code) {
  return code == DRIVEBENCH_OK ? code : fail(code, bench_.error());
}

int FmuInstance::acquire_all() {
  for (std::uint32_t axis = 0; axis < is_commanded_.size(); ++axis) {
    const int code = bench_.acquire(axis);
    is_commanded_[axis] = code == DRIVEBENCH_OK;
    if (code != DRIVEBENCH_OK && code != DRIVEBENCH_SHARED_AMPLIFIER) return checked(code);
  }
  return DRIVEBENCH_OK;
}

void FmuInstance::take_start_values() {
  set_.clear();
  commands_.assign(is_commanded_.size(), drivebench_command{});
  for (const fmi::Variable& variable : variables_) {
    set_.push_back(variable.start);
    put(variable, variable.start, commands_[variable.axis]);
  }
  time_s_ = start_s_;
}

double FmuInstance::value(std::size_t number) const {
  const fmi::Variable& variable = variables_[number];
  if (variable.purpose != Purpose::kSignal) return set_[number];
  const std::uint64_t bits = word(number);
  switch (variable.type) {
    case fmi::Type::kUInt64:
      return static_cast<double>(bits);
    case fmi::Type::kInt64:
      return static_cast<double>(static_cast<std::int64_t>(bits));
    case fmi::Type::kInt32:
    case fmi::Type::kReal:
      break;
  }
  return std::bit_cast<double>(bits);
}

std::uint64_t FmuInstance::word(std::size_t number) const noexcept {
  const fmi::Variable& variable = variables_[number];
  std::uint64_t bits = 0;
  const auto* const sample = reinterpret_cast<const unsigned char*>(&bench_.sample(variable.axis));
  std::memcpy(&bits, sample + variable.row * sizeof bits, sizeof bits);
  return bits;
}

int FmuInstance::set(std::size_t number, double value) {
  const fmi::Variable& variable = variables_[number];
  const std::uint32_t axis = variable.axis;
  if (!std::isfinite(value)) {
    return fail(DRIVEBENCH_NOT_FINITE, variable.name + " must be a finite number");
  }
  if (value < variable.minimum || value > variable.maximum) {
    return fail(DRIVEBENCH_OUT_OF_RANGE, variable.name + " is " + shortest(value) + " but must be " +
                                             shortest(variable.minimum) + " to " +
                                             shortest(variable.maximum));
  }
  const bool changes = value != set_[number];
  int code = DRIVEBENCH_OK;
  switch (variable.purpose) {
    case Purpose::kSetpoint:
    case Purpose::kGates:
    case Purpose::kLegsOff:
      put(variable, value, commands_[axis]);
      break;
    case Purpose::kLoad:
      if (changes) code = bench_.set_load(axis, value, 0, 0);
      break;
    case Purpose::kClear:
      if (changes && value != 0.0) code = bench_.clear(axis);
      break;
    case Purpose::kParameter:
      if (changes) {
        code = bench_.set(axis, bench_.describe().axes[axis].parameters[variable.row].name, value, 0, 0);
      }
      break;
    case Purpose::kFault:
      if (changes) code = bench_.inject(axis, bench_.describe().injectables[variable.row].name, value, 0);
      break;
    case Purpose::kSignal:
      return fail(DRIVEBENCH_READ_ONLY, variable.name + " is an output");
  }
  if (code != DRIVEBENCH_OK) return fail(code, variable.name + ": " + bench_.error());
  set_[number] = value;
  return DRIVEBENCH_OK;
}

std::vector<drivebench_command> FmuInstance::commands() {
  std::vector<drivebench_command> all;
  for (std::uint32_t axis = 0; axis < commands_.size(); ++axis) {
    if (!is_commanded_[axis]) continue;
    drivebench_command command = commands_[axis];
    command.axis = axis;
    command.tick = tick();
    if ((bench_.sample(axis).faults & latched_) != 0) command.gates = DRIVEBENCH_GATES_OFF;
    all.push_back(command);
  }
  return all;
}

int FmuInstance::start_at(double time_s) {
  if (!std::isfinite(time_s)) return fail(DRIVEBENCH_NOT_FINITE, "the start time must be a finite number");
  start_s_ = time_s_ = time_s;
  return DRIVEBENCH_OK;
}

int FmuInstance::advance(double from_s, double step_s) {
  const double period_s = bench_.describe().period_s;
  if (!std::isfinite(from_s) || !std::isfinite(step_s) || step_s <= 0.0) {
    return fail(DRIVEBENCH_BAD_ARGUMENT, "a step is from a finite time on and longer than 0 s");
  }
  if (std::abs(from_s - time_s_) > kSameTick * period_s) {
    return fail(DRIVEBENCH_BAD_ARGUMENT, "the step begins at " + shortest(from_s) +
                                             " s but the one before ended at " + shortest(time_s_) + " s");
  }
  const double end_tick = std::floor((from_s + step_s - start_s_) / period_s + kSameTick);
  while (static_cast<double>(tick()) < end_tick) {
    if (const int code = bench_.step(commands()); code != DRIVEBENCH_OK) return checked(code);
  }
  time_s_ = from_s + step_s;
  return DRIVEBENCH_OK;
}

int FmuInstance::reset() {
  if (const int code = bench_.reset(); code != DRIVEBENCH_OK) return checked(code);
  start_s_ = 0.0;
  take_start_values();
  return acquire_all();
}

std::vector<std::byte> FmuInstance::save() {
  std::vector<std::byte> bench;
  bench_.save(bench);
  const Header header{.inputs = set_.size(), .start_s = start_s_, .time_s = time_s_};
  std::vector<std::byte> state(sizeof header + set_.size() * sizeof(double));
  std::memcpy(state.data(), &header, sizeof header);
  std::memcpy(state.data() + sizeof header, set_.data(), set_.size() * sizeof(double));
  state.insert(state.end(), bench.begin(), bench.end());
  return state;
}

int FmuInstance::restore(std::span<const std::byte> state) {
  Header header{.magic = 0};
  const std::size_t inputs_size = set_.size() * sizeof(double);
  if (state.size() >= sizeof header) std::memcpy(&header, state.data(), sizeof header);
  if (header.magic != kMagic || header.inputs != set_.size() || state.size() < sizeof header + inputs_size) {
    return fail(DRIVEBENCH_MALFORMED,
                "these " + std::to_string(state.size()) + " bytes are no state of this unit");
  }
  const int code = bench_.restore(state.subspan(sizeof header + inputs_size));
  if (code != DRIVEBENCH_OK) return checked(code);
  start_s_ = header.start_s;
  time_s_ = header.time_s;
  std::memcpy(set_.data(), state.data() + sizeof header, inputs_size);
  for (std::size_t number = 0; number < variables_.size(); ++number)
    put(variables_[number], set_[number], commands_[variables_[number].axis]);
  return DRIVEBENCH_OK;
}

}  // namespace drivebench
