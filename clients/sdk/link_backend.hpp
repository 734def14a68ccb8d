#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "clients/link/tcp/tcp_link.hpp"
#include "protocols/abi/backend.hpp"
#include "protocols/abi/description.hpp"

namespace drivebench::sdk {

/// A bench behind a stream socket: tcp, tls or unix.
class LinkBackend final : public abi::Backend {
 public:
  /// Throws as link::Link does.
  LinkBackend(std::string_view address, const link::LinkOptions& options);
  ~LinkBackend() override;

  const drivebench_description& describe() const noexcept override { return description_->bench; }

  int acquire(std::uint32_t axis) noexcept override;
  int renew(std::uint32_t axis) noexcept override;
  int release(std::uint32_t axis) noexcept override;
  int clear(std::uint32_t axis) noexcept override;

  int step(std::span<const drivebench_command> commands) noexcept override;
  int newest(std::uint32_t axis) noexcept override;
  const Sample& sample(std::uint32_t axis) const noexcept override { return samples_[axis]; }

  int get(std::uint32_t axis, const char* name, double& value) noexcept override;
  int set(std::uint32_t axis, const char* name, double value, std::uint64_t ramp_ticks,
          std::uint64_t at_tick) noexcept override;
  int set_load(std::uint32_t axis, double load_nm, std::uint64_t ramp_ticks,
               std::uint64_t at_tick) noexcept override;
  int inject(std::uint32_t axis, const char* name, double value, std::uint64_t at_tick) noexcept override;
  int bump(std::uint32_t axis, double impulse_nms, std::uint64_t at_tick) noexcept override;

  int state_hash(std::uint64_t& hash) noexcept override;
  int reset() noexcept override;
  int save(std::vector<std::byte>& state) noexcept override;
  int restore(std::span<const std::byte> state) noexcept override;

 private:
  void keep(std::span<const link::AxisSample> samples);

  link::Link link_;
  std::unique_ptr<const abi::Description> description_;
  std::vector<link::AxisCommand> commands_;  // of the present step
  std::vector<Sample> samples_;              // by axis
  std::vector<bool> held_;                   // by axis: to be released at the end
};

}  // namespace drivebench::sdk
