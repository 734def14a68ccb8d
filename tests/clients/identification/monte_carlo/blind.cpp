#include "tests/clients/identification/monte_carlo/blind.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <numbers>
#include <random>

#include "clients/identification/find_wiring.hpp"
#include "clients/identification/identify.hpp"

namespace drivebench::identification {
namespace {

constexpr double kWireTurn = 2.0 * std::numbers::pi;

bool has_magnet(const MotorDraw& draw) {
  return draw.kind == MotorKind::kPmSynchronous || draw.kind == MotorKind::kBldc;
}

/// What the record alone does not say: kind, phases, counts, filters and the window.
Settings unwired(const Settings& all) {
  Settings e = all;
  e.pole_pairs = 1;
  e.processing.voltage_shift = 0.0;
  return e;
}

void score_wiring(BlindMotor& m, const Settings& truth, const Settings& found, const Result& result) {
  m.pole_pairs = found.pole_pairs == truth.pole_pairs;
  m.direction = found.reversed == m.wires.reversed;
  m.shift = found.processing.voltage_shift == truth.processing.voltage_shift + m.wires.late_samples;
  double zero = found.zero_rad * found.pole_pairs;
  for (const Estimate& error : result.sensors)
    zero += error.name == "angle offset" ? error.value : 0.0;
  // The angle of the settings is (reversed ? -1 : 1) times the column's, plus zero_rad.
  const double wanted = (m.wires.reversed ? 1.0 : -1.0) * m.wires.zero_counts * kWireTurn /
                        truth.counts_per_revolution * truth.pole_pairs;
  m.zero = !has_magnet(*m.draw) || std::abs(std::remainder(zero - wanted, kWireTurn)) < kWireTurn / 120.0;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  std::ranges::sort(values);
  return values[(values.size() - 1) / 2];
}

struct Sums {
  int motors = 0, wired = 0, certified = 0, stated = 0, held = 0, parameters = 0;
  std::vector<double> errors{};

  void add(const BlindMotor& m) {
    ++motors;
    wired += m.wired() ? 1 : 0;
    certified += m.certified ? 1 : 0;
    for (const Finding& f : m.findings) {
      ++parameters;
      if (!f.stated) continue;
      ++stated;
      held += f.covered() ? 1 : 0;
      errors.push_back(std::abs(f.error()));
    }
  }
  std::string row(std::string_view name) const {
    return fmt::format("| {} | {} | {} | {} | {} of {} | {} of {} | {:.3f} % | {:.3f} % |\n", name, motors,
                       wired, certified, stated, parameters, held, stated, 100.0 * median(errors),
                       100.0 * (errors.empty() ? std::nan("") : *std::ranges::max_element(errors)));
  }
};

}  // namespace

BlindMotor blind_motor(const MotorDraw& draw, std::uint64_t seed, int number) {
  std::seed_seq words{seed & 0xffffffffU, seed >> 32U, static_cast<std::uint64_t>(draw.kind),
                      static_cast<std::uint64_t>(number)};
  std::mt19937_64 engine(words);
  BlindMotor m{.draw = &draw};
  const std::vector<double> motor = draw_motor(draw, engine);
  Recorded run = record_motor(draw, motor, engine());
  m.wires = {
      .reversed = engine() % 2 == 1,
      .zero_counts = static_cast<int>(engine() % static_cast<std::uint64_t>(run.how.counts_per_revolution)),
      .late_samples = static_cast<int>(engine() % 4)};
  cross(run.data, m.wires);
  Settings e = unwired(run.how);
  Result result;
  try {
    find_wiring(run.data, e, {});
    result = identify(run.data, e);
  } catch (const IdentificationError&) {
    // Nothing is stated.
  }
  score_wiring(m, run.how, e, result);
  m.certified = result.excitation.sufficient;
  m.findings = findings_of(draw, motor, result);
  return m;
}

std::vector<BlindMotor> run_blind(std::uint64_t seed, int motors, int threads) {
  constexpr std::size_t kKinds = 5;
  const auto draws = motor_draws().first(kKinds);
  const auto per_kind = static_cast<std::size_t>(motors);
  std::vector<BlindMotor> all(per_kind * kKinds);
  const auto run_part = [&](std::size_t thread) {
    for (std::size_t k = thread; k < all.size(); k += static_cast<std::size_t>(threads))
      all[k] = blind_motor(draws[k / per_kind], seed, static_cast<int>(k % per_kind) + 1);
  };
  std::vector<std::future<void>> parts;
  for (std::size_t thread = 0; thread < static_cast<std::size_t>(threads); ++thread)
    parts.push_back(std::async(std::launch::async, run_part, thread));
  for (std::future<void>& part : parts)
    part.get();
  return all;
}

std::string blind_markdown(std::uint64_t seed, const std::vector<BlindMotor>& motors) {
  std::string text = fmt::format(
      "# Blind run, seed {}\n\n"
      "Parameters, noise, direction and zero of the encoder and a delay of the voltages of 0 to 3 samples "
      "come from "
      "the seed; the identification has the columns, the kind of motor and the counts of a turn.\n\n"
      "| motors | number | wiring right | certified | stated | in the interval | median error | worst |\n"
      "|---|---|---|---|---|---|---|---|\n",
      seed);
  Sums all;
  for (std::size_t k = 0; k < motors.size();) {
    const MotorDraw* const draw = motors[k].draw;
    Sums kind;
    for (; k < motors.size() && motors[k].draw == draw; ++k) {
      kind.add(motors[k]);
      all.add(motors[k]);
    }
    text += kind.row(draw->name);
  }
  return text + all.row("all");
}

}  // namespace drivebench::identification
