#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "plant/axis.hpp"
#include "plant/drive/leg_timer.hpp"
#include "plant/train/gate_tap.hpp"

namespace drivebench {

/// An event with its time.
struct GateEdge {
  Picoseconds at;
  EventKind kind;
  std::uint32_t channel;  ///< 0 for terminal a or line 1
  std::uint32_t level;    ///< 0 or 1, after it
};

/// An axis on a switched inverter at gate level: the legs are set at any instant, their timers play PWM and
/// dead time, and time goes on to any instant.
///
/// A tick is integrated in parts. One ends at a change of a leg, unless that moves no voltage, and on the
/// grid of the steps of the tick, never because a client asks: it is integrated to its end at once, and what
/// happens in it is told as time passes. set_leg() within it takes it back and integrates it up to that
/// instant. So nothing depends on how a client divides its run. The grid, the tick and the noise are those of
/// the bench; parameters, load and temperature are those of the tick.
class GateAxis {
 public:
  /// The parameters must be free of problems() and have a switched inverter.
  GateAxis(const AxisParameters& p, std::int64_t period_ns, int substeps, std::uint64_t seed,
           std::uint64_t index);
  GateAxis(const GateAxis&) = delete;
  GateAxis& operator=(const GateAxis&) = delete;
  ~GateAxis() = default;

  Picoseconds now() const noexcept { return now_; }
  int legs() const noexcept { return terminal_count(axis_.connection()); }
  const AxisParameters& parameters() const noexcept { return axis_.parameters(); }

  /// From now on. The setting has a period above 0 if its mode is one of PWM, and compare within it.
  void set_leg(std::size_t leg, const LegSetting& setting);
  /// From the next step on, at once.
  void set_load(double load_nm);
  /// From now on. The parameters must be free of problems() and differ in live ones only.
  void set_parameters(const AxisParameters& p);
  /// From now on; a fault of the gate driver from the next tick on.
  void inject(std::size_t row, double value);
  void clear_faults();

  /// Runs to `until`, not before now, and writes what happens up to there. It ends early at the event that
  /// fills `edges`; an empty one asks for none. The number of events written. An event that a change at
  /// `until` itself brings, such as a jump beyond a threshold, belongs to the next run.
  std::size_t run(Picoseconds until, std::span<GateEdge> edges);
  /// Nothing is due before this instant: skip_to() does up to there what run() would do.
  Picoseconds idle_before() const noexcept {
    const Picoseconds event_at = passed_ < log_.size() ? log_[passed_].edge.at : LegTimer::kNever;
    return diverged() ? now_ : std::min({clock_.at + 1, catch_up_at_, event_at, after(clock_.diverged_from)});
  }
  void skip_to(Picoseconds until) noexcept { now_ = until; }
  /// The first event up to `limit` if no leg is set before; changes nothing. Asked again it goes on from
  /// where it has looked to.
  std::optional<GateEdge> next_edge(Picoseconds limit);

  /// At this instant, before what is set at it acts.
  struct Now {
    AxisState state;
    GateTruth truth;
    GateSums sums;
    LegLevels levels;
  };
  Now look();
  /// Whether it has before now, however far next_edge() has looked.
  bool diverged() const noexcept { return clock_.diverged_from < now_; }
  /// Events that a part had beyond the room for them.
  std::uint64_t lost_events() const noexcept { return tap_.events.lost(); }

  /// The whole state but the parameters.
  std::vector<std::byte> save();
  /// Takes bytes of save() of an axis of the same parameters; is_possible_state judges the state of the axis
  /// in them. False for bytes that no save() has made: this axis is then of no use any more.
  bool restore(std::span<const std::byte> bytes, bool (*is_possible_state)(const AxisState&) noexcept);

 private:
  /// What goes on with time beside the axis. 8-byte members only.
  struct Clock {
    Picoseconds at = 0;
    std::int64_t tick_open = 0;                    ///< 1: within a tick
    std::int64_t hall_count = 0;                   ///< sectors of 60 electrical degrees
    Picoseconds diverged_from = LegTimer::kNever;  ///< the start of the part in which the machine has
    std::array<LegTimer, 3> legs{};
    std::array<std::int64_t, 3> flow{};  ///< signs of the terminals' currents
  };
  /// All that goes on with time.
  struct Moment {
    Clock clock{};
    GateSums sums{};
    AxisState axis{};
  };
  /// What has been told of the comparators and Hall lines: a part that is cut goes on from there, because
  /// its last digits are those of a shorter integration.
  struct Told {
    std::uint64_t levels = 0;
    std::array<std::uint64_t, 3> edges{};
    std::int64_t hall_count = 0;
  };
  /// The currents that have died and the break that has opened the legs, told at the instant at which a leg
  /// was set last: the state is cut within a picosecond of them, so that they may come once more.
  struct Cut {
    Picoseconds at = 0;
    std::uint64_t told = 0;  ///< bits of bit_in_cut()
  };
  struct Logged {
    GateEdge edge{};
    std::int64_t hall_count = 0;  ///< of a Hall edge, after it
  };
  /// What extend() integrates in one part of the tick.
  struct Part {
    Picoseconds to = 0;
    LegLevels levels{};
    std::uint64_t joined = 0;  ///< bit 0 for a: legs that change within it without moving their voltage
  };
  /// What save() writes; behind it the events that have been told and not been handed out.
  struct Saved {
    Moment base{};
    Picoseconds now = 0;
    Told told{};
    Cut cut{};
    std::uint64_t passed = 0;
    std::uint64_t told_count = 0;
  };

  /// Where the axis is, into a moment of this axis: each part does so, and a whole copy has 6 kB.
  void keep(Moment& moment) const;
  /// Takes the parts of a state that keep() leaves out.
  void begin_with(const AxisState& state);
  /// Begins at the present moment: the next part is the first one that is looked at.
  void begin_here();
  void go_back(const Moment& moment);
  void go_back(const AxisState& state);
  /// Runs one part, which ends at `limit` at the latest.
  void extend(Picoseconds limit);
  /// The part that begins now. With ideal switches and diodes a leg whose switches are open is where the
  /// closed switch of the rail beside its conducting diode would hold it: `may_join` lets the part go on over
  /// changes between the two, such as dead time, as long as that current flows.
  Part part_up_to(Picoseconds limit, bool may_join) const noexcept;
  /// extend(), with joined legs or without; false if the current of a joined leg has not gone on.
  bool try_to_extend(Picoseconds limit, bool may_join);
  /// Whether the axis has come to the end of the part. False if the current of a joined leg has not gone on.
  bool run_part(const Part& part);
  void log_events(Picoseconds from);
  void log_hall(Picoseconds from);
  void log_one(const Logged& event, std::size_t first);
  void tell(const Logged& event) noexcept;
  static std::uint64_t bit_in_cut(const GateEdge& edge) noexcept;
  /// Takes what has happened now into the cut.
  void add_to_cut() noexcept;
  /// Whether the cut has told it already.
  bool in_cut(const GateEdge& edge) const noexcept {
    return edge.at <= cut_.at + 1 && (cut_.told & bit_in_cut(edge)) != 0;
  }
  /// From base to now; what happens on the way is known.
  void run_to_now();
  /// Lets base follow to the last end of a part up to now, where a client only looks ahead and runs: else
  /// the log and what look() integrates again would grow for ever.
  void catch_up();
  bool is_possible(const Saved& saved) const noexcept;
  bool is_possible(const Logged& event) const noexcept;
  /// Whether the count of sectors differs by a thousand turns at most from that of the rotor's angle. Without
  /// Hall sensors every count is possible.
  bool is_possible_hall_count(std::int64_t count, const AxisState& state) const noexcept;
  Now seen() const;
  /// Lets a part end now.
  void stop_here();
  Tick tick() const noexcept { return clock_.at / period_; }
  Picoseconds grid_after(Picoseconds at) const noexcept;
  double within_tick_s(Picoseconds at) const noexcept;
  Picoseconds at_of(double within_tick_s, Picoseconds from) const noexcept;

  static Picoseconds after(Picoseconds at) noexcept { return at == LegTimer::kNever ? at : at + 1; }

  static constexpr Picoseconds kNowhere = -1;

  Axis axis_;
  GateTap tap_;
  Encoder hall_;  ///< whose counts are sectors
  double pole_pairs_;
  bool joins_legs_;
  Picoseconds period_;
  int substeps_;

  Clock clock_{};      ///< where the axis is: at the end of a part, not before now_
  Moment base_{};      ///< where that part, or the first one that next_edge() has looked at, began
  Moment unjoined_{};  ///< before a part with joined legs that does not begin at base_
  Moment here_{};      ///< at now_, if run_to_now() has been there since begin_here(); else at kNowhere
  Moment aside_{};     ///< where it was before look() or catch_up() took it back
  Picoseconds now_ = 0;
  std::vector<Logged> log_{};                   ///< what happens from base_ on
  std::size_t passed_ = 0;                      ///< of them, which have been handed out
  std::size_t told_count_ = 0;                  ///< of them, which told_ has already
  std::size_t ahead_ = 0;                       ///< parts that next_edge() has looked at since base_
  Picoseconds catch_up_at_ = LegTimer::kNever;  ///< so many that base_ has to follow
  Told told_{};
  Cut cut_{};
};

}  // namespace drivebench
