#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "protocols/abi/backend.hpp"
#include "protocols/abi/description.hpp"
#include "server/bench/bench.hpp"
#include "server/bench/change_requests.hpp"
#include "server/config/config.hpp"

namespace drivebench {

/// The configuration in a bench file. Throws ConfigError, for implausible values as well.
BenchConfig load_inproc_config(const std::filesystem::path& bench_file);

/// A bench with one controller in the same process, without clock, thread or socket: what a lockstep server
/// is to its first session. The same requests give the same samples, refusals and hash.
class InprocBench final : public abi::Backend {
 public:
  explicit InprocBench(const BenchConfig& config);

  const drivebench_description& describe() const noexcept override { return description_.bench; }

  int acquire(std::uint32_t axis) noexcept override { return lease(axis, LeaseAction::kAcquire); }
  int renew(std::uint32_t axis) noexcept override { return lease(axis, LeaseAction::kRenew); }
  int release(std::uint32_t axis) noexcept override { return lease(axis, LeaseAction::kRelease); }
  int clear(std::uint32_t axis) noexcept override;

  int step(std::span<const drivebench_command> commands) noexcept override;
  int newest(std::uint32_t axis) noexcept override { return check_axis(axis); }
  const Sample& sample(std::uint32_t axis) const noexcept override { return bench_.sample(axis); }

  int get(std::uint32_t axis, const char* name, double& value) noexcept override;
  int set(std::uint32_t axis, const char* name, double value, std::uint64_t ramp_ticks,
          std::uint64_t at_tick) noexcept override;
  int set_load(std::uint32_t axis, double load_nm, std::uint64_t ramp_ticks,
               std::uint64_t at_tick) noexcept override;
  int inject(std::uint32_t axis, const char* name, double value, std::uint64_t at_tick) noexcept override;
  int bump(std::uint32_t axis, double impulse_nms, std::uint64_t at_tick) noexcept override;

  int event_tick(std::size_t event, std::int64_t& tick) noexcept override;
  int state_hash(std::uint64_t& hash) noexcept override;
  int reset() noexcept override { return restore(start_); }
  int save(std::vector<std::byte>& state) noexcept override;
  int restore(std::span<const std::byte> state) noexcept override;

 private:
  /// The number of the controller: the first that a server gives.
  static constexpr Owner kOwner = 1;

  int check_axis(std::uint32_t axis) noexcept;
  int check_commands(std::span<const drivebench_command> commands) noexcept;
  int lease(std::uint32_t axis, LeaseAction action) noexcept;
  /// Gives the bench a command of the controller.
  int give(const drivebench_command& c) noexcept;
  /// Gives the bench an input of the controller; `field` is that of the bench's refusal.
  int submit(std::uint32_t axis, std::uint64_t at_tick, const JudgedRequest& judged,
             const char* field) noexcept;
  /// Whether the controller may change the axis.
  int check_owner(std::uint32_t axis) noexcept;
  int fail_with(Refused why, std::uint32_t axis, std::string field, std::string more = {}) noexcept;
  ChangeView change_view(std::uint32_t axis) const noexcept;
  void describe_bench();

  BenchConfig config_;
  Bench bench_;
  std::vector<std::byte> start_;  ///< the state at tick 0
  abi::Description description_;
};

}  // namespace drivebench
