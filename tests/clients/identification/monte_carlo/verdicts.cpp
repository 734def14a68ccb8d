#include "tests/clients/identification/monte_carlo/verdicts.hpp"

#include <algorithm>
#include <cmath>
#include <future>
#include <random>
#include <string>

#include "clients/identification/identify.hpp"

namespace drivebench::identification {
namespace {

double uniform(std::mt19937_64& engine) {
  return static_cast<double>(engine() >> 11) * 0x1p-53;
}

/// Between 3 and 50 % of the record, evenly in the logarithm, anywhere in it.
void take_part(Recorded& run, std::mt19937_64& engine) {
  const double whole_s = run.data.period_s * static_cast<double>(run.data.samples());
  const double part_s = whole_s * 0.03 * std::pow(0.5 / 0.03, uniform(engine));
  run.how.processing.from_s = (whole_s - part_s) * uniform(engine);
  run.how.processing.to_s = run.how.processing.from_s + part_s;
}

bool is_linear(std::string_view name) {
  return name == "f" || name == "f_c" || name == "tau_L";
}

}  // namespace

VerdictFinding verdict_of(const MotorDraw& draw, int number, Look look) {
  VerdictFinding found;
  if (look == Look::kWrongPolePairs && draw.kind == MotorKind::kDc) return {.applies = false};
  std::mt19937_64 engine(7'000'000 + static_cast<std::uint64_t>(number));
  Recorded run = record_motor(draw, number, 1);
  if (look == Look::kPart) take_part(run, engine);
  if (look == Look::kWrongPolePairs) run.how.pole_pairs += run.how.pole_pairs > 1 && number % 2 == 0 ? -1 : 1;
  const std::vector<double> motor = draw_motor(draw, number);
  try {
    const Result result = identify(run.data, run.how);
    found.certified = result.excitation.sufficient;
    found.right = true;
    for (std::size_t k = 0; k < draw.identified.size(); ++k) {
      const std::string name(draw.identified[k].name);
      const Estimate* const e = result.find(name);
      const double error = e == nullptr ? HUGE_VAL : std::abs(e->value / motor[k] - 1.0);
      found.right = found.right && error < (is_linear(name) ? 0.3 : 0.05);
      if (e == nullptr || result.is_unseen(name)) continue;
      found.wrong = found.wrong || (error > 0.05 && error * motor[k] > 2.0 * e->interval.value_or(0.0));
    }
  } catch (const IdentificationError&) {
    found.right = false;  // the record is too short to be looked at
  }
  return found;
}

std::vector<VerdictTrials> run_verdicts(std::span<const MotorDraw> draws, int motors, int threads) {
  std::vector<VerdictTrials> trials;
  for (const MotorDraw& draw : draws) {
    for (std::size_t look = 0; look < kLooks.size(); ++look)
      trials.push_back({.draw = &draw,
                        .look = static_cast<Look>(look),
                        .findings = std::vector<VerdictFinding>(static_cast<std::size_t>(motors))});
  }
  const auto per_trial = static_cast<std::size_t>(motors);
  const auto run_part = [&](std::size_t thread) {
    for (std::size_t k = thread; k < per_trial * trials.size(); k += static_cast<std::size_t>(threads)) {
      VerdictTrials& trial = trials[k / per_trial];
      trial.findings[k % per_trial] =
          verdict_of(*trial.draw, static_cast<int>(k % per_trial) + 1, trial.look);
    }
  };
  std::vector<std::future<void>> parts;
  for (std::size_t thread = 0; thread < static_cast<std::size_t>(threads); ++thread)
    parts.push_back(std::async(std::launch::async, run_part, thread));
  for (std::future<void>& part : parts)
    part.get();
  return trials;
}

}  // namespace drivebench::identification
