#include <array>
#include <cmath>
#include <complex>
#include <span>
#include <utility>

#include "clients/identification/identify.hpp"
#include "clients/identification/math/elimination.hpp"
#include "clients/identification/motors/induction/induction_motor.hpp"
#include "clients/identification/motors/induction/resistance_tracking.hpp"
#include "tests/book/results/results.hpp"
#include "tests/clients/identification/bench_data.hpp"

namespace drivebench {
namespace {

using namespace identification;
using StartRecorder = identification::Recorder;

constexpr double kLeakage = 1.0 - 0.64 * 0.64 / (0.67 * 0.67);

std::vector<Measured> estimates(const identification::Result& found,
                                std::initializer_list<const char*> names) {
  std::vector<Measured> measured;
  for (const char* name : names) {
    const Estimate& e = *found.find(name);
    measured.push_back(number(e.name, e.value, e.unit == "1" ? "" : e.unit));
  }
  return measured;
}

/// The start of 8.5.5 at 20 kHz with sensors and filters.
std::vector<Measured> start(std::initializer_list<const char*> names) {
  BenchConfig config = bench_config("im-8-5-5");
  set_rate(config, 50'000, 4);
  BookBench run(config);
  StartRecorder record = line_recorder(run.period_s(), false);
  run.run_until(0.21, std::ref(record));
  Settings e{.kind = MotorKind::kInduction,
             .pole_pairs = 2,
             .counts_per_revolution = 2048,
             .load = LoadModel::kConstant};
  e.processing = usual_processing(e.kind, run.period_s());
  e.processing.from_s = 0.005;
  e.processing.to_s = 0.2;
  return estimates(identify_by_equations(record.data(), e), names);
}

std::vector<Measured> conversion() {
  const InductionParameters p = induction_parameters(519.7, 1848.3, 0.1311, 259.5);
  return {number("R_S", p.stator_resistance_ohm, "ohm"), number("L_S", p.stator_inductance_h, "H"),
          number("sigma", p.leakage_factor, ""), number("M", p.mutual_inductance_h, "H"),
          number("R_R", p.rotor_resistance_ohm, "ohm")};
}

/// 0.2 s of steady state under load, 4 kHz, 4096 counts, filters 100 Hz.
std::vector<Measured> resistances(double stator_factor, double rotor_factor) {
  BenchConfig config = bench_config("im-8-5-5");
  AxisParameters& p = config.setup.axes[0].parameters;
  auto& machine = std::get<InductionMachineParameters>(p.machine);
  machine.stator_resistance_ohm *= stator_factor;
  machine.rotor_resistance_ohm *= rotor_factor;
  p.encoder.counts_per_revolution = 4096;
  BookBench run(config);
  run.run_until(1.5);
  StartRecorder record = line_recorder(run.period_s(), false);
  run.run_until(1.75, std::ref(record));
  Settings e{.kind = MotorKind::kInduction, .pole_pairs = 2, .counts_per_revolution = 4096};
  e.processing.voltage_shift = 0.0;
  e.processing.current = e.processing.voltage = e.processing.shaft = {.order = 3, .cutoff_hz = 100.0};
  const auto instants = induction_instants(record.data(), e);
  const ResistanceEstimate found = identify_resistances(
      std::span(instants).subspan(100, 800), 2.0, {.stator_inductance_h = 0.67, .leakage_factor = kLeakage});
  return {number("R_S", found.stator_resistance_ohm, "ohm"), number("T_R", found.rotor_time_constant_s, "s")};
}

/// Sylvester's resultant of x2^2 + x2 + x1 and -x1 x2^2 + x2 + 1 by x2.
std::vector<Measured> elimination() {
  using InX1 = Polynomial<double>;
  using InX2 = Polynomial<InX1>;
  const InX1 x1(std::vector<double>{0.0, 1.0});
  const InX1 r = resultant(InX2(std::vector<InX1>{x1, 1, 1}), InX2(std::vector<InX1>{1, 1, -x1}));
  std::vector<Measured> measured;
  for (std::size_t power = 0; power < r.coefficients().size(); ++power)
    measured.push_back(number("x1^" + std::to_string(power), r.coefficients()[power], ""));
  const std::complex<double> zero(0.0, std::sqrt(3.0));
  measured.push_back({"at j1.732", std::abs(r.at(zero)), "", 1e-9});
  return measured;
}

}  // namespace

ResultSection identification_results() {
  return {"Identification of the induction motor (section 8.5)",
          {{"20", "start from the line, 20 kHz, 2048 counts, 12 bits, filters 200 and 100 Hz",
            "K4 1743, K6 3917, K8 0.0780, K14 222.2; true 1717.2, 3839.8, 0.0779, 218.83",
            start({"K4", "K6", "K8", "K14"}), "closer to the truth: central differences, one filter, 20 kHz"},
           {"20", "the same in the motor's own parameters",
            "R_S 9.8, L_S 0.6698, sigma 0.086, J 0.010, tau_L 3.68; true 9.7, 0.67, 0.0875, 0.011, 3.7",
            start({"R_S", "L_S", "sigma", "J", "tau_L"}), "closer to the truth: as above"},
           {"23", "K4, K6, K8, K14 of the experiment of 8.5.6 to parameters",
            "R_S 5.12, L_S 0.2919, sigma 0.1007, M 0.2768, R_R 2.23", conversion(), "agrees"},
           {"24", "R_S and T_R in steady state by the resultant of degree 5",
            "simulated 9.648, 0.07790; true 9.7, 0.0779", resistances(1.0, 1.0), "agrees"},
           {"24", "the same, R_S 1.2 and R_R 1.5 times as large", "simulated 11.64, 0.05194; true the same",
            resistances(1.2, 1.5), "agrees"},
           {"25", "elimination of x2 from x2² + x2 + x1 and −x1 x2² + x2 + 1",
            "r = (3 + x1²) x1², zeros 0, 0, ±j1.732", elimination(), "agrees"}}};
}

}  // namespace drivebench
