#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "plant/math/frames.hpp"
#include "plant/math/noise.hpp"
#include "plant/sensors/event_log.hpp"
#include "plant/tick.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench {

/// The voltage that a comparator holds against its terminal.
enum class ComparatorReference : std::int64_t {
  kVirtualNeutral,  ///< the mean of the three terminals: three equal resistors
  kHalfLink,        ///< the middle of the DC link
  kFixed,           ///< reference_v against the negative rail
};

/// Section [axis.comparator]: for each terminal of a star a comparator of its voltage behind an RC with a
/// reference behind the same RC. All voltages are those at the terminal: a divider scales them alike.
struct ComparatorParameters {
  bool enabled = false;
  ComparatorReference reference = ComparatorReference::kVirtualNeutral;
  double reference_v = 0.0;   ///< kFixed: against the negative rail
  double rc_s = 0.0;          ///< time constant; 0: none
  double hysteresis_v = 0.0;  ///< the level rises above half of it and falls below minus half of it
  double offset_a_v = 0.0;    ///< added to what the comparator of a sees
  double offset_b_v = 0.0;
  double offset_c_v = 0.0;
  double noise_rms_v = 0.0;  ///< Gaussian, constant for about a microsecond, of each comparator its own
};

/// All that the comparators remember. 8-byte members only.
struct ComparatorMemory {
  ThreePhase filtered_v{};  ///< terminal less reference, behind the RC
  std::array<std::uint64_t, 3> edges{};
  std::array<Tick, 3> edge_tick{};  ///< of the last edge
  std::array<double, 3> edge_s{};   ///< from the start of that tick
  std::uint64_t levels = 0;         ///< 1 a, 2 b, 4 c: above the reference
};

/// The terminals against the negative rail during an interval, in which each goes along a parabola.
struct TerminalPath {
  ThreePhase start_v{};
  ThreePhase middle_v{};
  ThreePhase end_v{};
  double link_v = 0.0;
};

/// The comparators of an axis. Behind the RC a parabola stays one, with an exponential: every crossing is
/// found as a zero of that sum, so that its time does not depend on the length of the intervals.
class Comparators {
 public:
  /// Noise channels from noise_channel to noise_channel + 2 are used.
  Comparators(const ComparatorParameters& p, double period_s, std::uint64_t seed,
              std::uint64_t noise_channel) noexcept;
  void set_parameters(const ComparatorParameters& p) noexcept { p_ = p; }
  bool enabled() const noexcept { return p_.enabled; }

  /// As if the terminals had been in the middle of the link for ever.
  ComparatorMemory settled(double link_v) const noexcept;
  /// The interval from start_s within the tick. Its edges go to `log` as well, unless that is null.
  void follow(ComparatorMemory& m, Tick tick, double start_s, double duration_s, const TerminalPath& path,
              EventLog* log = nullptr) const noexcept;
  /// Their signals at the start of `tick`.
  void read(const ComparatorMemory& m, Tick tick, Sample& sample) const noexcept;

 private:
  class Input;
  /// Where and when a comparator looks.
  struct Place {
    int terminal;
    Tick tick;
    double start_s;
    double duration_s;
    EventLog* log;
  };

  /// What a voltage is between. An RC stays between where it has come to and what it is given from there on.
  struct Span {
    double lowest_v;
    double highest_v;

    Span with(double v) const noexcept {
      return {.lowest_v = std::min(lowest_v, v), .highest_v = std::max(highest_v, v)};
    }
  };

  double offset_v(int terminal) const noexcept;
  /// The voltage that is missing to the threshold; negative: the input is beyond it somewhere.
  double away_v(const ComparatorMemory& m, int terminal, const Span& span) const noexcept;
  /// Whether the voltage that is missing to the threshold is more than any noise.
  bool is_out_of_reach(double away_v) const noexcept;
  /// `given` is what the input before the RC is between.
  void switch_within(ComparatorMemory& m, const Place& place, const Input& input,
                     const Span& given) const noexcept;
  /// `from` and `to` are parts of the interval, 0 to 1.
  void switch_within(ComparatorMemory& m, const Place& place, const Input& input, double added_v, double from,
                     double to) const noexcept;

  ComparatorParameters p_;
  double period_s_;
  std::int64_t noise_steps_;  ///< in a tick
  double noise_step_s_;
  std::array<NoiseChannel, 3> noise_;
};

}  // namespace drivebench
