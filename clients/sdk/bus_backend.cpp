#include "clients/sdk/bus_backend.hpp"

#include <string>
#include <utility>

#include "clients/sdk/link_description.hpp"
#include "clients/sdk/requests.hpp"

namespace drivebench::sdk {

BusBackend::BusBackend(std::unique_ptr<link::AxisLink> link)
    : link_(std::move(link)), description_(sdk::describe(link_->bench(), link_->known())) {}

int BusBackend::check_axis(std::uint32_t axis) noexcept {
  if (axis == 0) return DRIVEBENCH_OK;
  return fail(DRIVEBENCH_UNKNOWN_AXIS,
              "axis " + std::to_string(axis) + " does not exist; this address leads to one axis, number 0",
              "axis");
}

int BusBackend::not_carried(const char* what) noexcept {
  return fail(DRIVEBENCH_NOT_AVAILABLE,
              std::string(what) + " cannot go over a field bus: use tcp, tls, unix or inproc");
}

int BusBackend::acquire(std::uint32_t axis) noexcept {
  if (const int code = check_axis(axis); code != DRIVEBENCH_OK) return code;
  return carry_out(*this, [&] {
    link_->acquire();
    description_->bench.mode =
        static_cast<std::int32_t>(link_->bench().mode());  // CAN tells it with the lease
  });
}

int BusBackend::release(std::uint32_t axis) noexcept {
  if (const int code = check_axis(axis); code != DRIVEBENCH_OK) return code;
  return carry_out(*this, [&] { link_->release(); });
}

int BusBackend::clear(std::uint32_t axis) noexcept {
  if (const int code = check_axis(axis); code != DRIVEBENCH_OK) return code;
  return carry_out(*this, [&] { link_->clear_faults(); });
}

int BusBackend::step(std::span<const drivebench_command> commands) noexcept {
  for (const drivebench_command& command : commands) {
    if (const int code = check_axis(command.axis); code != DRIVEBENCH_OK) return code;
    if (command.gates == DRIVEBENCH_GATES_EDGES) return not_carried("edges of legs");
  }
  if (commands.size() > 1) {
    return fail(DRIVEBENCH_OUT_OF_RANGE, "two commands for one axis", "commands.axis");
  }
  return carry_out(*this, [&] { keep(link_->exchange(command_for(commands.front()))); });
}

int BusBackend::newest(std::uint32_t axis) noexcept {
  if (const int code = check_axis(axis); code != DRIVEBENCH_OK) return code;
  return carry_out(*this, [&] { keep(link_->newest()); });
}

/// The members that the link does not carry stay as they were made: 0.
void BusBackend::keep(const Sample& sample) {
  for (std::size_t row = 0; row < kSignals.size(); ++row) {
    if ((link_->known() >> row & 1) == 0) continue;
    const Signal& signal = kSignals[row];
    if (signal.as_unsigned != nullptr) sample_.*signal.as_unsigned = sample.*signal.as_unsigned;
    if (signal.as_signed != nullptr) sample_.*signal.as_signed = sample.*signal.as_signed;
    if (signal.as_real != nullptr) sample_.*signal.as_real = sample.*signal.as_real;
  }
}

int BusBackend::get(std::uint32_t, const char*, double&) noexcept {
  return not_carried("reading a parameter by its name");
}

int BusBackend::set(std::uint32_t, const char*, double, std::uint64_t, std::uint64_t) noexcept {
  return not_carried("writing a parameter by its name");
}

int BusBackend::set_load(std::uint32_t, double, std::uint64_t, std::uint64_t) noexcept {
  return not_carried("a load");
}

int BusBackend::inject(std::uint32_t, const char*, double, std::uint64_t) noexcept {
  return not_carried("a fault");
}

int BusBackend::bump(std::uint32_t, double, std::uint64_t) noexcept {
  return not_carried("a bump");
}

int BusBackend::state_hash(std::uint64_t&) noexcept {
  return not_carried("the state hash");
}

}  // namespace drivebench::sdk
