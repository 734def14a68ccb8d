#pragma once

#include <memory>

#include "clients/link/common/axis_link.hpp"
#include "protocols/abi/backend.hpp"
#include "protocols/abi/description.hpp"

namespace drivebench::sdk {

/// One axis behind a field bus: can or modbus. It is axis 0, whatever its number on the bench.
class BusBackend final : public abi::Backend {
 public:
  explicit BusBackend(std::unique_ptr<link::AxisLink> link);

  const drivebench_description& describe() const noexcept override { return description_->bench; }

  int acquire(std::uint32_t axis) noexcept override;
  int renew(std::uint32_t axis) noexcept override { return acquire(axis); }
  int release(std::uint32_t axis) noexcept override;
  int clear(std::uint32_t axis) noexcept override;

  int step(std::span<const drivebench_command> commands) noexcept override;
  int newest(std::uint32_t axis) noexcept override;
  const Sample& sample(std::uint32_t) const noexcept override { return sample_; }

  int get(std::uint32_t axis, const char* name, double& value) noexcept override;
  int set(std::uint32_t axis, const char* name, double value, std::uint64_t ramp_ticks,
          std::uint64_t at_tick) noexcept override;
  int set_load(std::uint32_t axis, double load_nm, std::uint64_t ramp_ticks,
               std::uint64_t at_tick) noexcept override;
  int inject(std::uint32_t axis, const char* name, double value, std::uint64_t at_tick) noexcept override;
  int bump(std::uint32_t axis, double impulse_nms, std::uint64_t at_tick) noexcept override;

  int state_hash(std::uint64_t& hash) noexcept override;

 private:
  int check_axis(std::uint32_t axis) noexcept;
  int not_carried(const char* what) noexcept;
  void keep(const Sample& sample);

  std::unique_ptr<link::AxisLink> link_;
  std::unique_ptr<abi::Description> description_;
  Sample sample_;
};

}  // namespace drivebench::sdk
