#include <memory>
#include <string_view>
#include <vector>

#include "clients/control/moves/step_train.hpp"
#include "clients/control/presets/presets_families.hpp"
#include "clients/control/synchronous/stepper_controller.hpp"

namespace drivebench::control::stepper_presets {
namespace {

constexpr double kStep_rad = 1.8 / 57.29577951308232;

constexpr StepperParameters kFull = {
    .pole_pairs = 50.0, .sample_rate_hz = 10e3, .counts_per_revolution = 2000.0, .amplitude = 3.3};
constexpr StepperParameters kWeak = with(kFull, &StepperParameters::amplitude, 1.1);

constexpr StepTrainParameters kFourSteps = {.step_rad = kStep_rad, .steps = 4.0, .rate_hz = 5.0};
constexpr StepTrainParameters kEightHalfSteps = {.step_rad = 0.5 * kStep_rad, .steps = 8.0, .rate_hz = 5.0};
constexpr StepTrainParameters kMicroSteps = {.step_rad = kStep_rad / 16.0, .steps = 64.0, .rate_hz = 100.0};
constexpr StepTrainParameters kOneStep = {.step_rad = kStep_rad, .steps = 1.0, .rate_hz = 2.0};
constexpr StepTrainParameters k200Hz = {.step_rad = kStep_rad, .steps = 40.0, .rate_hz = 200.0};
constexpr StepTrainParameters k400Hz = {.step_rad = kStep_rad, .steps = 40.0, .rate_hz = 400.0};

constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.1, .hold_s = 0.5};

Run run(const StepperParameters& p, const StepTrainParameters& train, const RunTiming& timing) {
  return run_at(p.sample_rate_hz, std::make_unique<StepperController>(p), std::make_shared<StepTrain>(train),
                timing);
}

Preset preset(std::string_view name, std::string_view source, std::string_view expectation,
              const StepperParameters& p, const StepTrainParameters& train) {
  const bool by_current = p.drive == Quantity::kCurrent;
  return preset_of({name, source, expectation, by_current ? "stepper-current" : "pm-stepper"},
                   {.machine_kind = "pm_synchronous",
                    .counts_per_revolution = p.counts_per_revolution,
                    .pole_pairs = p.pole_pairs,
                    .voltage_limit_v = by_current ? 1000.0 : p.amplitude,
                    .quantity = p.drive},
                   run, p, train, kTiming);
}

}  // namespace

std::vector<Preset> all() {
  using P = StepperParameters;
  return {
      preset("book/9.4-full", "Chiasson 2005, 9.4: full steps from voltages", "1.8 degrees a step, exactly",
             kFull, kFourSteps),
      preset("book/9.10-half", "Chiasson 2005, problem 9.10: half steps", "0.9 degrees a step, exactly",
             with(kFull, &P::mode, StepMode::kHalf), kEightHalfSteps),
      preset("stepper/micro", "as book/9.4-full with 16 microsteps in a step",
             "0.1125 degrees a step, exactly", with(kFull, &P::mode, StepMode::kMicro, &P::microsteps, 16.0),
             kMicroSteps),
      preset("book/9.4-current", "Chiasson 2005, figure 9.36: one step, driven by a current of 1 A",
             "3.46 degrees after 7.96 ms, then rings at 73.0 Hz",
             with(kFull, &P::amplitude, 1.0, &P::drive, Quantity::kCurrent), kOneStep),
      preset("stepper/train-200", "40 full steps at 1.1 V, 200 a second", "makes 40 steps", kWeak, k200Hz),
      preset("stepper/train-400", "40 full steps at 1.1 V, 400 a second",
             "fails: makes 4 steps; what is lost are whole electrical turns", kWeak, k400Hz),
  };
}

}  // namespace drivebench::control::stepper_presets
