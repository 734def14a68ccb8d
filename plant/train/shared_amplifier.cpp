#include "plant/train/shared_amplifier.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "plant/drive/phases.hpp"
#include "plant/faults.hpp"
#include "plant/train/drive_train.hpp"

namespace drivebench {
namespace {

// A sum of currents below this is none: where it dies, rounding leaves about 1e-13 of it.
constexpr double kNoCurrentA = 1e-9;

double of_phase(const PhaseValues& x, int k) noexcept {
  return k == 0 ? x.a : (k == 1 ? x.b : x.c);
}

PhaseValues side_current_a(const SharedAmplifier::Side& side) noexcept {
  const RotorMotion motion{.angle_rad = side.state.shaft.angle_rad,
                           .speed_rad_s = side.state.shaft.speed_rad_s,
                           .electrical = {.cos = 1.0, .sin = 0.0}};
  return terminal_currents(side.core.connection, side.train.truth(side.state, motion).current_a,
                           side.state.open_terminals);
}

ThreePhase centred(const ThreePhase& v) noexcept {
  const double mean_v = (v.a + v.b + v.c) / 3.0;
  return {.a = v.a - mean_v, .b = v.b - mean_v, .c = v.c - mean_v};
}

/// A small system of linear equations, by elimination. An unknown without effect becomes 0.
struct Equations {
  int count = 0;
  std::array<std::array<double, 3>, 3> slope{};
  std::array<double, 3> value{};

  std::array<double, 3> solved() noexcept {
    for (int column = 0; column < count; ++column)
      eliminate(at(column));
    std::array<double, 3> x{};
    for (int row = count; row-- > 0;) {
      double rest = value[at(row)];
      for (int k = row + 1; k < count; ++k)
        rest -= slope[at(row)][at(k)] * x[at(k)];
      const double pivot = slope[at(row)][at(row)];
      x[at(row)] = pivot != 0.0 ? rest / pivot : 0.0;
    }
    return x;
  }

 private:
  static std::size_t at(int k) noexcept { return static_cast<std::size_t>(k); }

  void eliminate(std::size_t column) noexcept {
    std::size_t best = column;
    for (std::size_t row = column; row < at(count); ++row) {
      if (std::abs(slope[row][column]) > std::abs(slope[best][column])) best = row;
    }
    std::swap(slope[column], slope[best]);
    std::swap(value[column], value[best]);
    if (slope[column][column] == 0.0) return;
    for (std::size_t row = column + 1; row < at(count); ++row) {
      const double factor = slope[row][column] / slope[column][column];
      for (std::size_t k = column; k < at(count); ++k)
        slope[row][k] -= factor * slope[column][k];
      value[row] -= factor * value[column];
    }
  }
};

}  // namespace

SharedAmplifier::SharedAmplifier(const Side& first, const Side& second, const PhaseCommand& command,
                                 Tick tick) noexcept
    : first_(first), second_(second), drive_(first.core.drive), memory_(first.state.drive) {
  InjectedFaults faults = first.state.injected;
  faults.open_phase = 0.0;  // a wire of the first machine, not of the second
  drive_.begin_tick(memory_, command, faults, tick);
  if ((first.state.faults & kGatesOffFaults) != 0) drive_.switch_off(memory_);
  first_.state.drive.switched_off = second_.state.drive.switched_off = 0.0;
}

PhaseValues SharedAmplifier::total_a() const noexcept {
  const auto sum = [](double x, double y) noexcept { return x + y; };
  return by_terminal(sum, side_current_a(first_), side_current_a(second_));
}

void SharedAmplifier::run_both(const TerminalDrive& out, double start_s, double end_s) noexcept {
  for (Side* const side : {&first_, &second_}) {
    side->core.drive.share_output(out);
    side->state.drive.bus_v = memory_.bus_v;  // for its sensors
    side->train.run_part(side->core, side->state, start_s, end_s, side->load_nm);
  }
}

/// The trip of one machine, by its currents or by a short, is that of both: the amplifier switches off.
void SharedAmplifier::share_trip() noexcept {
  const std::uint64_t trip = (first_.state.faults | second_.state.faults) & (kOverCurrent | kGatesOffFaults);
  first_.state.faults |= trip;
  second_.state.faults |= trip;
  first_.state.drive.switched_off = second_.state.drive.switched_off = 0.0;
  if ((trip & kGatesOffFaults) != 0) drive_.switch_off(memory_);
}

void SharedAmplifier::run_piece(double start_s, double end_s) noexcept {
  for (std::size_t events = 0; start_s < end_s; ++events) {
    const PhaseValues from_a = total_a();
    TerminalDrive out = drive_.at(memory_, start_s, end_s - start_s, from_a);
    double stop_s = end_s;
    if (driven_count(first_.core.connection, out) == terminal_count(first_.core.connection)) {
      run_both(out, start_s, end_s);
    } else {
      stop_s = run_undriven(out, start_s, end_s, events < kMaxEvents);
    }
    const PhaseValues voltage_v{
        .a = out.start_v.a, .b = out.start_v.b, .c = out.start_v.c, .field = out.field_v};
    drive_.finish(memory_, start_s, stop_s - start_s, out, voltage_v, from_a, total_a());
    start_s = stop_s;
  }
}

/// Every terminal becomes one with a voltage: of its switch, of a rail, or to be found.
auto SharedAmplifier::sorted(TerminalDrive& out, double start_s) const noexcept -> Undriven {
  Undriven piece{.start = {.first = first_.state,
                           .second = second_.state,
                           .first_segments = first_.core.segment_count,
                           .second_segments = second_.core.segment_count},
                 .start_s = start_s};
  const PhaseValues current_a = total_a();
  for (int k = 0; k < terminal_count(first_.core.connection); ++k) {
    TerminalMode& mode = out.mode[static_cast<std::size_t>(k)];
    if (std::exchange(mode, TerminalMode::kDriven) == TerminalMode::kDriven) continue;
    const double i = of_phase(current_a, k);
    (std::abs(i) > kNoCurrentA ? piece.dying : piece.floating) |= terminal_bit(k);
    phase(out.start_v, k) = std::abs(i) > kNoCurrentA ? terminals_detail::against(i, out.rail_v) : 0.0;
  }
  return piece;
}

double SharedAmplifier::run_undriven(TerminalDrive& out, double start_s, double end_s,
                                     bool may_cut) noexcept {
  const Undriven piece = sorted(out, start_s);
  const TerminalDrive begun = out;
  const auto dying_a = [&piece](const PhaseValues& current_a) noexcept {
    EventValues values;
    for (int k = 0; k < 3; ++k) {
      if ((piece.dying & terminal_bit(k)) != 0) values.add(of_phase(current_a, k));
    }
    return values;
  };
  const EventValues before = dying_a(total_a());
  const double duration_s = end_s - start_s;
  const EventValues after = dying_a(settle(out, piece, end_s));
  if (!may_cut) return end_s;
  const Crossing crossing = located_event(before, after, [&](double fraction) noexcept {
    out = begun;
    return dying_a(settle(out, piece, start_s + fraction * duration_s));
  });
  return crossing.fraction < 1.0 ? start_s + crossing.fraction * duration_s : end_s;
}

PhaseValues SharedAmplifier::try_piece(const TerminalDrive& out, const Undriven& piece,
                                       double end_s) noexcept {
  first_.state = piece.start.first;
  second_.state = piece.start.second;
  first_.core.segment_count = piece.start.first_segments;
  second_.core.segment_count = piece.start.second_segments;
  run_both(out, piece.start_s, end_s);
  return total_a();
}

PhaseValues SharedAmplifier::settle(TerminalDrive& out, const Undriven& piece, double end_s) noexcept {
  TerminalSet floating = piece.floating;
  // One terminal of a star alone carries nothing.
  const bool star = first_.core.connection == Connection::kStar;
  if (star && std::popcount(floating) == 2) floating = terminals();
  // Each pass lets at least one more terminal conduct.
  for (int pass = 0; pass < 3 && floating != 0; ++pass) {
    const PhaseValues end_a = float_terminals(out, piece, floating, end_s);
    if (!clamp_one(out, floating)) return end_a;
  }
  return try_piece(out, piece, end_s);
}

/// Newton's method on the voltages for the sums of the currents at the end, which are nearly linear in them.
PhaseValues SharedAmplifier::float_terminals(TerminalDrive& out, const Undriven& piece, TerminalSet floating,
                                             double end_s) noexcept {
  constexpr int kRefinements = 3;
  constexpr double kSmallA = 1e-3 * kNoCurrentA;
  constexpr double kProbeV = 1.0;
  std::array<int, 3> unknown{};
  int count = 0;
  for (int k = 0; k < 3; ++k) {
    if ((floating & terminal_bit(k)) != 0) unknown[static_cast<std::size_t>(count++)] = k;
  }
  // A star without any terminal that conducts: only the differences count, and the common part is 0.
  const bool all_float = first_.core.connection == Connection::kStar && count == 3;
  if (all_float) count = 2;
  Equations slopes{.count = count};
  PhaseValues end_a = try_piece(out, piece, end_s);
  for (int n = 0; n < kRefinements; ++n) {
    Equations equations = slopes;
    double most_a = 0.0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      equations.value[i] = -of_phase(end_a, unknown[i]);
      most_a = std::max(most_a, std::abs(equations.value[i]));
    }
    if (most_a <= kSmallA) break;
    if (n == 0) {
      for (std::size_t j = 0; j < static_cast<std::size_t>(count); ++j) {
        TerminalDrive tried = out;
        phase(tried.start_v, unknown[j]) += kProbeV;
        const PhaseValues tried_a = try_piece(tried, piece, end_s);
        for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
          slopes.slope[i][j] = (of_phase(tried_a, unknown[i]) - of_phase(end_a, unknown[i])) / kProbeV;
        }
      }
      equations.slope = slopes.slope;
    }
    const std::array<double, 3> step_v = equations.solved();
    for (std::size_t j = 0; j < static_cast<std::size_t>(count); ++j)
      phase(out.start_v, unknown[j]) += step_v[j];
    if (all_float) out.start_v = centred(out.start_v);
    end_a = try_piece(out, piece, end_s);
  }
  return end_a;
}

/// A diode begins to conduct where a floating terminal is beyond its rail; in a star of which nothing
/// conducts two do, if the voltage between them is beyond the whole link. Whether one has begun.
bool SharedAmplifier::clamp_one(TerminalDrive& out, TerminalSet& floating) const noexcept {
  const auto clamp = [&](int k, double side) noexcept {
    phase(out.start_v, k) = side * out.rail_v;
    floating &= ~terminal_bit(k);
  };
  if (first_.core.connection == Connection::kStar && floating == terminals()) {
    ThreePhase& v = out.start_v;
    int high = 0;
    int low = 0;
    for (int k = 1; k < 3; ++k) {
      if (phase(v, k) > phase(v, high)) high = k;
      if (phase(v, k) < phase(v, low)) low = k;
    }
    if (phase(v, high) - phase(v, low) <= 2.0 * out.rail_v) return false;
    clamp(high, 1.0);
    clamp(low, -1.0);
    return true;
  }
  for (int k = 0; k < terminal_count(first_.core.connection); ++k) {
    const double v = phase(out.start_v, k);
    if ((floating & terminal_bit(k)) == 0 || std::abs(v) <= out.rail_v) continue;
    clamp(k, v > 0.0 ? 1.0 : -1.0);
    return true;
  }
  return false;
}

/// The fault line pulls the break inputs of both.
double SharedAmplifier::break_stop_s(double start_s, double end_s) noexcept {
  for (Side* const side : {&first_, &second_})
    meet_break(side->core, side->state, start_s, {});
  share_trip();
  return std::min({end_s, first_.state.break_input.opens_s(), second_.state.break_input.opens_s()});
}

void SharedAmplifier::run() noexcept {
  const AxisCore& core = first_.core;
  for (int n = 0; n < core.timing.substeps; ++n) {
    const double end_s = (n + 1) * core.step_s;
    for (double start_s = n * core.step_s; start_s < end_s;) {
      const double edge_s = std::min(end_s, drive_.next_edge_s(memory_, start_s));
      const double stop_s = core.breaks ? break_stop_s(start_s, edge_s) : edge_s;
      run_piece(start_s, stop_s);
      share_trip();
      start_s = stop_s;
    }
    check_over_current(first_.core, first_.state, total_a());
    share_trip();
  }
  first_.state.drive = second_.state.drive = memory_;
}

}  // namespace drivebench
