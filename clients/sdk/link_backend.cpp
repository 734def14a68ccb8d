#include "clients/sdk/link_backend.hpp"

#include <string>

#include "clients/link/tcp/tcp_axis.hpp"
#include "clients/sdk/link_description.hpp"
#include "clients/sdk/requests.hpp"

namespace drivebench::sdk {

LinkBackend::LinkBackend(std::string_view address, const link::LinkOptions& options)
    : link_(address, options),
      description_(sdk::describe(link_.welcome().bench(), kAllSignals)),
      samples_(description_->bench.axis_count),
      held_(description_->bench.axis_count) {
  commands_.reserve(samples_.size());
}

LinkBackend::~LinkBackend() {
  for (std::uint32_t axis = 0; axis < held_.size(); ++axis) {
    if (held_[axis]) release(axis);
  }
}

int LinkBackend::acquire(std::uint32_t axis) noexcept {
  return carry_out(*this, [&] {
    link_.acquire(axis);
    held_[axis] = true;
  });
}

int LinkBackend::renew(std::uint32_t axis) noexcept {
  return carry_out(*this, [&] { link_.renew(axis); });
}

int LinkBackend::release(std::uint32_t axis) noexcept {
  return carry_out(*this, [&] {
    link_.release(axis);
    held_[axis] = false;
  });
}

int LinkBackend::clear(std::uint32_t axis) noexcept {
  return carry_out(*this, [&] { link_.clear_faults(axis); });
}

int LinkBackend::step(std::span<const drivebench_command> commands) noexcept {
  return carry_out(*this, [&] {
    commands_.clear();
    for (const drivebench_command& command : commands)
      commands_.push_back(command_for(command));
    keep(link_.exchange(commands_));
  });
}

int LinkBackend::newest(std::uint32_t axis) noexcept {
  if (axis >= samples_.size()) {
    return fail(
        DRIVEBENCH_UNKNOWN_AXIS,
        "axis " + std::to_string(axis) + " does not exist; the bench has " + std::to_string(samples_.size()),
        "axis");
  }
  return carry_out(*this, [&] { keep(link_.exchange({})); });
}

void LinkBackend::keep(std::span<const link::AxisSample> samples) {
  for (const link::AxisSample& each : samples) {
    if (each.axis < samples_.size()) samples_[each.axis] = each.sample;
  }
}

int LinkBackend::get(std::uint32_t axis, const char* name, double& value) noexcept {
  return carry_out(*this, [&] {
    const std::string wanted(name);
    const v1::ParameterValues& values = link_.read_parameters(axis, std::span(&wanted, 1));
    if (values.parameters_size() != 1)
      throw link::LinkError(link_.peer() + " answered without the parameter");
    value = values.parameters(0).value();
  });
}

int LinkBackend::set(std::uint32_t axis, const char* name, double value, std::uint64_t ramp_ticks,
                     std::uint64_t at_tick) noexcept {
  return carry_out(*this, [&] {
    link_.write_parameter(axis, {.name = name, .value = value, .ramp_ticks = ramp_ticks, .at_tick = at_tick});
  });
}

int LinkBackend::set_load(std::uint32_t axis, double load_nm, std::uint64_t ramp_ticks,
                          std::uint64_t at_tick) noexcept {
  return carry_out(*this, [&] {
    link_.set_load(axis, {.load_nm = load_nm, .ramp_ticks = ramp_ticks, .at_tick = at_tick});
  });
}

int LinkBackend::inject(std::uint32_t axis, const char* name, double value, std::uint64_t at_tick) noexcept {
  return carry_out(*this,
                   [&] { link_.inject_fault(axis, {.name = name, .value = value, .at_tick = at_tick}); });
}

int LinkBackend::bump(std::uint32_t axis, double impulse_nms, std::uint64_t at_tick) noexcept {
  return carry_out(*this, [&] { link_.bump_shaft(axis, impulse_nms, at_tick); });
}

int LinkBackend::state_hash(std::uint64_t& hash) noexcept {
  if (describe().mode != DRIVEBENCH_MODE_LOCKSTEP) {
    return fail(DRIVEBENCH_WRONG_MODE, "only a lockstep bench tells its state hash while it runs");
  }
  return carry_out(*this, [&] { hash = link_.status().state_hash(); });
}

int LinkBackend::reset() noexcept {
  return carry_out(*this, [&] {
    link_.reset();
    keep(link_.exchange({}));
  });
}

int LinkBackend::save(std::vector<std::byte>& state) noexcept {
  return carry_out(*this, [&] {
    const std::string saved = link_.save_state().state;
    const std::span<const std::byte> bytes = std::as_bytes(std::span(saved));
    state.assign(bytes.begin(), bytes.end());
  });
}

int LinkBackend::restore(std::span<const std::byte> state) noexcept {
  return carry_out(*this, [&] {
    link_.restore_state({reinterpret_cast<const char*>(state.data()), state.size()});
    keep(link_.exchange({}));
  });
}

}  // namespace drivebench::sdk
