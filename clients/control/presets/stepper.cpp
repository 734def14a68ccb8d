#include <array>

#include "clients/control/moves/step_train.hpp"
#include "clients/control/presets/presets_families.hpp"
#include "clients/control/synchronous/stepper_controller.hpp"

namespace drivebench::control {
namespace {

constexpr double kStep_rad = 1.8 / 57.29577951308232;

constexpr StepperParameters driver(StepMode mode, double microsteps, double amplitude,
                                   Quantity drive) noexcept {
  return {.pole_pairs = 50.0,
          .sample_rate_hz = 10e3,
          .counts_per_revolution = 2000.0,
          .amplitude = amplitude,
          .microsteps = microsteps,
          .mode = mode,
          .drive = drive};
}

constexpr StepperParameters kFull = driver(StepMode::kFull, 1.0, 3.3, Quantity::kVoltage);
constexpr StepperParameters kHalf = driver(StepMode::kHalf, 1.0, 3.3, Quantity::kVoltage);
constexpr StepperParameters kMicro = driver(StepMode::kMicro, 16.0, 3.3, Quantity::kVoltage);
constexpr StepperParameters kWeak = driver(StepMode::kFull, 1.0, 1.1, Quantity::kVoltage);
constexpr StepperParameters kCurrent = driver(StepMode::kFull, 1.0, 1.0, Quantity::kCurrent);

constexpr StepTrainParameters kFourSteps = {.step_rad = kStep_rad, .steps = 4.0, .rate_hz = 5.0};
constexpr StepTrainParameters kEightHalfSteps = {.step_rad = 0.5 * kStep_rad, .steps = 8.0, .rate_hz = 5.0};
constexpr StepTrainParameters kMicroSteps = {.step_rad = kStep_rad / 16.0, .steps = 64.0, .rate_hz = 100.0};
constexpr StepTrainParameters kOneStep = {.step_rad = kStep_rad, .steps = 1.0, .rate_hz = 2.0};
constexpr StepTrainParameters k200Hz = {.step_rad = kStep_rad, .steps = 40.0, .rate_hz = 200.0};
constexpr StepTrainParameters k400Hz = {.step_rad = kStep_rad, .steps = 40.0, .rate_hz = 400.0};

constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.1, .hold_s = 0.5};

template <const StepperParameters& kP, const StepTrainParameters& kTrain>
constexpr Preset preset(std::string_view name, std::string_view source, std::string_view expectation) {
  const bool by_current = kP.drive == Quantity::kCurrent;
  return {.name = name,
          .source = source,
          .expectation = expectation,
          .bench = by_current ? "stepper-current" : "pm-stepper",
          .needs = {.machine_kind = "pm_synchronous",
                    .counts_per_revolution = kP.counts_per_revolution,
                    .pole_pairs = kP.pole_pairs,
                    .voltage_limit_v = by_current ? 1000.0 : kP.amplitude,
                    .quantity = kP.drive},
          .gains = [] { return gains_of(kP, kTrain, kTiming); },
          .make = [](std::span<const Gain> overrides) -> Run {
            auto [p, train, timing] = with_gains(std::tuple{kP, kTrain, kTiming}, overrides);
            timing.sample_rate_hz = p.sample_rate_hz;
            return {std::make_unique<StepperController>(p), std::make_shared<StepTrain>(train), timing};
          }};
}

constexpr auto kPresets = std::to_array<Preset>({
    preset<kFull, kFourSteps>("book/9.4-full", "Chiasson 2005, 9.4: full steps from voltages",
                              "1.8 degrees a step, exactly"),
    preset<kHalf, kEightHalfSteps>("book/9.10-half", "Chiasson 2005, problem 9.10: half steps",
                                   "0.9 degrees a step, exactly"),
    preset<kMicro, kMicroSteps>("stepper/micro", "as book/9.4-full with 16 microsteps in a step",
                                "0.1125 degrees a step, exactly"),
    preset<kCurrent, kOneStep>("book/9.4-current",
                               "Chiasson 2005, figure 9.36: one step, driven by a current of 1 A",
                               "3.46 degrees after 7.96 ms, then rings at 73.0 Hz"),
    preset<kWeak, k200Hz>("stepper/train-200", "40 full steps at 1.1 V, 200 a second", "makes 40 steps"),
    preset<kWeak, k400Hz>("stepper/train-400", "40 full steps at 1.1 V, 400 a second",
                          "fails: makes 4 steps; what is lost are whole electrical turns"),
});

}  // namespace

std::span<const Preset> stepper_presets() noexcept {
  return kPresets;
}

}  // namespace drivebench::control
