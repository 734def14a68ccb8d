#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "plant/gate_axis.hpp"
#include "protocols/abi/bridge.hpp"
#include "server/config/config.hpp"

namespace drivebench {

/// The last instant to which a bridge goes.
inline constexpr std::uint64_t kLastBridgePs = kLastPicosecond;

/// An axis of a bench at gate level, behind the C ABI.
class InprocBridge final : public abi::Bridge {
 public:
  /// Why this axis has no bridge: a code and a sentence; DRIVEBENCH_OK if it has one.
  struct Problem {
    int code;
    std::string sentence;
  };
  static Problem problem_with(const BenchConfig& config, std::uint32_t axis);

  /// Without a problem.
  InprocBridge(const BenchConfig& config, std::uint32_t axis);

  int set(std::uint32_t leg, const drivebench_leg& setting) noexcept override;
  int run(std::uint64_t until_ps, std::span<drivebench_bridge_edge> edges,
          std::size_t& count) noexcept override;
  int next_edge(std::uint64_t limit_ps, drivebench_bridge_edge& edge, bool& found) noexcept override;
  int read(drivebench_bridge_state& state) noexcept override;
  int mark() noexcept override;
  int mean(drivebench_bridge_means& means) noexcept override;
  int set_load(double load_nm) noexcept override;
  int get_parameter(const char* name, double& value) noexcept override;
  int set_parameter(const char* name, double value) noexcept override;
  int inject(const char* name, double value) noexcept override;
  int clear() noexcept override;
  int save(std::vector<std::byte>& state) noexcept override;
  int restore(std::span<const std::byte> state) noexcept override;

 private:
  /// What mean() counts from.
  struct Mark {
    Picoseconds at = 0;
    double angle_rad = 0.0;
    GateSums sums{};
  };
  /// In front of the live parameters, in the order of their table, and of the state of the axis in what
  /// save() gives.
  struct Header {
    std::uint64_t magic;
    std::uint64_t configuration;
    std::uint64_t digest;  ///< of all that follows
    Mark mark;
  };

  /// A time that is to come.
  int check_time(const char* name, std::uint64_t at_ps) noexcept {
    return at_ps >= now_ps() && at_ps <= kLastBridgePs ? DRIVEBENCH_OK : refuse_time(name, at_ps);
  }
  int refuse_time(const char* name, std::uint64_t at_ps) noexcept;
  int check_finite() noexcept { return axis_->diverged() ? refuse_diverged() : DRIVEBENCH_OK; }
  int refuse_diverged() noexcept;
  /// The axis, which run_idle() leaves behind, at the present time.
  GateAxis& axis() noexcept {
    axis_->skip_to(static_cast<Picoseconds>(now_ps()));
    return *axis_;
  }
  /// After each call that changes it.
  void keep_time() noexcept {
    set_time(static_cast<std::uint64_t>(axis_->now()),
             std::min(static_cast<std::uint64_t>(axis_->idle_before()), kLastBridgePs + 1));
  }
  /// Runs to `until` or until the room for edges is full; `count` of them are written.
  static void run_with(GateAxis& axis, std::span<drivebench_bridge_edge> edges, Picoseconds until,
                       std::size_t& count) noexcept;
  Mark mark_of_now() noexcept;
  /// The axis at tick 0, all legs open.
  std::unique_ptr<GateAxis> new_axis() const;
  std::vector<double> live_values() const;
  /// Those of the bench file with these live ones; nothing: they are not possible.
  std::optional<AxisParameters> with_live_values(std::span<const double> values) const;

  AxisParameters parameters_;  ///< of the bench file
  std::int64_t period_ns_;
  int substeps_;
  std::uint64_t seed_;
  std::uint32_t index_;
  std::uint64_t configuration_;
  std::unique_ptr<GateAxis> axis_;
  Mark mark_{};
};

}  // namespace drivebench
