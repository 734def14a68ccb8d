#include "clients/command/identify/suggest/suggest_design.hpp"

#include <algorithm>
#include <cstddef>

namespace drivebench::command {
namespace {

using identification::BenchParameters;
using identification::MotorKind;
using identification::SearchVariable;

constexpr double kLeastPart = 1e-3;      ///< of the voltage limit, the smallest amplitude
constexpr double kSamplesOfSine = 20.0;  ///< the fewest in a period

SearchVariable amplitude(double part, const ExperimentLimits& limits) {
  return {.start = part * limits.voltage_v, .least = kLeastPart * limits.voltage_v, .most = limits.voltage_v};
}

SearchVariable frequency(double turns, const ExperimentLimits& limits, double period_s) {
  return {.start = turns / limits.duration_s,
          .least = 1.0 / limits.duration_s,
          .most = 1.0 / (kSamplesOfSine * period_s)};
}

/// An instant, by parts of the duration.
SearchVariable instant(double least, double start, double most, const ExperimentLimits& limits) {
  return {.start = start * limits.duration_s,
          .least = least * limits.duration_s,
          .most = most * limits.duration_s};
}

void add_sine(v1::RunExperiment& request, v1::Channel channel, double amplitude_v, double frequency_hz) {
  v1::Shape& shape = *request.mutable_input()->add_shapes();
  shape.set_channel(channel);
  shape.mutable_sine()->set_amplitude(amplitude_v);
  shape.mutable_sine()->set_frequency_hz(frequency_hz);
}

ExperimentDesign armature_voltage(const ExperimentLimits& limits, double period_s) {
  return {.sentence =
              "A slow sine of the voltage that turns the motor, and a fast one that shows its inductance.",
          .variables = {amplitude(0.4, limits), frequency(4.0, limits, period_s), amplitude(0.2, limits),
                        frequency(40.0, limits, period_s)},
          .excite = [](const std::vector<double>& x, v1::RunExperiment& request) {
            request.mutable_input()->set_kind(v1::INPUT_KIND_PHASE_VOLTAGES);
            add_sine(request, v1::CHANNEL_A, x[0], x[1]);
            add_sine(request, v1::CHANNEL_A, x[2], x[3]);
          }};
}

ExperimentDesign turning_voltage(const BenchParameters& bench, bool has_d, const ExperimentLimits& limits,
                                 double period_s) {
  const auto constant = bench.find("machine.torque_constant_nm_per_a");
  const double back_emf_vs = has_d && constant != bench.end() ? constant->second : 0.0;
  ExperimentDesign design = {.sentence = "A slow and a fast sine of u_q; the voltages turn with the motor.",
                             .variables = {amplitude(0.3, limits), frequency(3.0, limits, period_s),
                                           amplitude(0.1, limits), frequency(20.0, limits, period_s)},
                             .excite = [=](const std::vector<double>& x, v1::RunExperiment& request) {
                               v1::ExperimentInput& input = *request.mutable_input();
                               input.set_kind(v1::INPUT_KIND_DQ_VOLTAGES);
                               input.set_angle(v1::ANGLE_SOURCE_TRUE);
                               input.set_back_emf_vs(back_emf_vs);
                               add_sine(request, v1::CHANNEL_Q, x[0], x[1]);
                               add_sine(request, v1::CHANNEL_Q, x[2], x[3]);
                               if (has_d) add_sine(request, v1::CHANNEL_D, x[4], x[5]);
                             }};
  if (has_d) {
    design.sentence = "A slow and a fast sine of u_q and one of u_d; the voltages turn with the motor.";
    design.variables.push_back(amplitude(0.1, limits));
    design.variables.push_back(frequency(30.0, limits, period_s));
  }
  return design;
}

void add_event(v1::RunExperiment& request, double at_s, const char* name, double value) {
  v1::ExperimentEvent& event = *request.add_events();
  event.set_at_s(at_s);
  event.mutable_parameter()->set_name(name);
  event.mutable_parameter()->set_value(value);
}

void set(v1::RunExperiment& request, const char* name, double value) {
  auto& settings = *request.mutable_settings();
  const auto found = std::ranges::find(settings, name, &v1::NamedValue::name);
  v1::NamedValue& setting = found != settings.end() ? *found : *settings.Add();
  setting.set_name(name);
  setting.set_value(value);
}

void add_rotating(v1::RunExperiment& request, double amplitude_v, double frequency_hz, double from_s,
                  double to_s) {
  v1::Shape& shape = *request.mutable_input()->add_shapes();
  shape.set_start_s(from_s);
  shape.set_end_s(to_s);
  shape.mutable_three_phase()->set_amplitude(amplitude_v);
  shape.mutable_three_phase()->set_frequency_hz(frequency_hz);
}

ExperimentDesign line_start(bool source, const BenchParameters& bench, const ExperimentLimits& limits) {
  const auto rated = bench.find("source.frequency_hz");
  const double rated_hz = source && rated != bench.end() && rated->second > 0.0 ? rated->second : 50.0;
  const SearchVariable hertz = {.start = rated_hz, .least = 0.1 * rated_hz, .most = 2.0 * rated_hz};
  return {.sentence = "A start, and after it another amplitude and frequency.",
          .variables = {amplitude(1.0, limits), hertz, amplitude(0.7, limits), hertz,
                        instant(0.1, 0.7, 0.95, limits)},
          .excite = [=](const std::vector<double>& x, v1::RunExperiment& request) {
            if (!source) {
              request.mutable_input()->set_kind(v1::INPUT_KIND_PHASE_VOLTAGES);
              add_rotating(request, x[0], x[1], 0.0, x[4]);
              add_rotating(request, x[2], x[3], x[4], 0.0);
              return;
            }
            request.mutable_input()->set_kind(v1::INPUT_KIND_SOURCE);
            set(request, "source.amplitude_v", x[0]);
            set(request, "source.frequency_hz", x[1]);
            add_event(request, x[4], "source.amplitude_v", x[2]);
            add_event(request, x[4], "source.frequency_hz", x[3]);
          }};
}

}  // namespace

std::vector<double> gentlest(const ExperimentDesign& design) {
  std::vector<double> at;
  for (std::size_t k = 0; k < design.variables.size(); ++k)
    at.push_back(k % 2 == 0 ? design.variables[k].least : design.variables[k].most);
  return at;
}

ExperimentDesign design_for(const identification::MotorName& motor, std::string_view drive,
                            const BenchParameters& bench, const ExperimentLimits& limits, double period_s) {
  switch (motor.kind) {
    case MotorKind::kDc:
      return armature_voltage(limits, period_s);
    case MotorKind::kPmSynchronous:
      return turning_voltage(bench, true, limits, period_s);
    case MotorKind::kBldc:
      return turning_voltage(bench, false, limits, period_s);
    case MotorKind::kInduction:
      break;
  }
  return line_start(drive == "source", bench, limits);
}

}  // namespace drivebench::command
