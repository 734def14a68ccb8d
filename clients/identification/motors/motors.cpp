#include "clients/identification/motors/motors.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace drivebench::identification {
namespace {

using Truth = std::map<std::string, double, std::less<>>;

/// Reads parameters by name; `all_known` becomes false when one is missing.
class Reader {
 public:
  explicit Reader(const BenchParameters& bench) : bench_(bench) {}

  double operator()(std::string_view name) {
    const auto found = bench_.find(name);
    if (found != bench_.end()) return found->second;
    all_known_ = false;
    return 0.0;
  }
  double or_else(std::string_view name, double other) const {
    const auto found = bench_.find(name);
    return found == bench_.end() ? other : found->second;
  }
  bool all_known() const noexcept { return all_known_; }

 private:
  const BenchParameters& bench_;
  bool all_known_ = true;
};

Truth saturated_truth(Reader& read) {
  Truth truth = {{"R_S", read("machine.stator_resistance_ohm")},
                 {"R_R", read("machine.rotor_resistance_ohm")},
                 {"l_s", read("machine.stator_leakage_h")},
                 {"l_r", read("machine.rotor_leakage_h")}};
  return read.all_known() ? truth : Truth{};
}

/// Source: the book, (8.97)-(8.101).
Truth induction_truth(Reader& read) {
  if (read.or_else("machine.stator_leakage_h", 0.0) > 0.0) return saturated_truth(read);
  const double r_s = read("machine.stator_resistance_ohm");
  const double r_r = read("machine.rotor_resistance_ohm");
  const double l_s = read("machine.stator_inductance_h");
  const double l_r = read("machine.rotor_inductance_h");
  const double m = read("machine.mutual_inductance_h");
  if (!read.all_known()) return {};
  const double t_r = l_r / r_r;
  const double sigma = 1.0 - m * m / (l_s * l_r);
  const double gamma = (r_s + (1.0 - sigma) * l_s / t_r) / (sigma * l_s);
  return {{"R_S", r_s},
          {"T_R", t_r},
          {"L_S", l_s},
          {"sigma", sigma},
          {"M", l_s * std::sqrt(1.0 - sigma)},
          {"L_R", l_s},
          {"R_R", l_s / t_r},
          {"K4", (1.0 - sigma) / (sigma * t_r * t_r)},
          {"K6", gamma / t_r},
          {"K8", t_r},
          {"K14", 1.0 / (sigma * l_s * t_r)}};
}

Truth pm_truth(Reader& read) {
  const double l_d = read("machine.inductance_d_h");
  const double l_q = read("machine.inductance_q_h");
  Truth truth = {{"R_S", read("machine.stator_resistance_ohm")},
                 {"K_m", read("machine.torque_constant_nm_per_a")}};
  if (!read.all_known()) return {};
  if (std::abs(l_d - l_q) < 1e-9 * l_d) {
    truth.emplace("L_S", l_d);
  } else {
    truth.insert({{"L_d", l_d}, {"L_q", l_q}, {"L_g", 0.5 * (l_d - l_q)}});
  }
  truth.emplace("f_c", read.or_else("mechanics.coulomb_friction_nm", 0.0));
  return truth;
}

Truth bldc_truth(Reader& read) {
  Truth truth = {{"R_S", read("machine.stator_resistance_ohm")},
                 {"L+M", read("machine.self_inductance_h") + read("machine.mutual_inductance_h")},
                 {"tau_p", read("machine.torque_constant_nm_per_a")}};
  return read.all_known() ? truth : Truth{};
}

Truth dc_truth(Reader& read) {
  Truth truth = {{"R", read("machine.armature_resistance_ohm")},
                 {"L", read("machine.armature_inductance_h")},
                 {"K_T", read("machine.torque_constant_nm_per_a")}};
  return read.all_known() ? truth : Truth{};
}

Truth electrical_truth(MotorKind kind, Reader& read) {
  switch (kind) {
    case MotorKind::kInduction:
      return induction_truth(read);
    case MotorKind::kPmSynchronous:
      return pm_truth(read);
    case MotorKind::kBldc:
      return bldc_truth(read);
    case MotorKind::kDc:
      break;
  }
  return dc_truth(read);
}

}  // namespace

bool is_machine_of(std::string_view machine, std::string_view motor_machine) noexcept {
  return machine == motor_machine || (motor_machine == "induction" && machine == "saturated_induction");
}

const MotorName* find_motor(std::string_view name) noexcept {
  const auto* const found = std::ranges::find(kMotorNames, name, &MotorName::name);
  return found == kMotorNames.end() ? nullptr : &*found;
}

const MotorName& motor_name(MotorKind kind) noexcept {
  return *std::ranges::find(kMotorNames, kind, &MotorName::kind);
}

void take_facts(const BenchParameters& bench, std::string_view drive, int substeps, MeasurementFacts& facts) {
  const Reader read(bench);
  facts.pole_pairs = static_cast<int>(std::clamp(read.or_else("machine.pole_pairs", 1.0), 1.0, 1000.0));
  facts.counts_per_revolution = read.or_else("encoder.counts_per_revolution", 0.0);
  facts.half_count = read.or_else("encoder.half_count_offset", 0.0) == 0.0;
  facts.voltage_held_ticks = 1.0;
  facts.note.clear();
  const double delay_ticks = read.or_else("amplifier.delay_ticks", 0.0);
  const bool filtered = drive != "current_amplifier" && drive != "switched_inverter" &&
                        read.or_else("amplifier.filter_hz", 0.0) > 0.0;
  if (drive == "source" || filtered) {
    facts.voltage_held_ticks = 0.0;
  } else if (drive == "current_amplifier") {
    facts.voltage_held_ticks = 1.0 / std::max(1, substeps);
    if (substeps > 1)
      facts.note =
          "the current amplifier moves its voltage within a tick, of which the data show the end: "
          "inductances "
          "are too small unless a tick is one step";
  } else if (drive == "switched_inverter") {
    facts.note =
        "the voltages are those of the switches at the end of a tick, not means: do not trust these numbers";
  } else if (delay_ticks != std::floor(delay_ticks)) {
    facts.note =
        "commands take hold within a tick, of which the data show the end: voltages are up to a tick early";
  }
}

Settings settings_of(MotorKind kind, const MeasurementFacts& facts, double period_s) {
  Settings e{.kind = kind,
             .pole_pairs = facts.pole_pairs,
             .three_phase = facts.three_phase,
             .counts_per_revolution = facts.counts_per_revolution,
             .half_count = facts.half_count};
  e.processing = usual_processing(kind, period_s);
  e.processing.voltage_shift = 0.5 * facts.voltage_held_ticks / std::max(1, facts.decimation);
  return e;
}

Truth truth_of(MotorKind kind, const BenchParameters& bench) {
  Reader read(bench);
  Truth truth = electrical_truth(kind, read);
  if (truth.empty()) return truth;
  if (read.or_else("thermal.enabled", 0.0) != 0.0) {
    for (const char* name : {"R", "R_S", "T_R", "R_R", "K4", "K6", "K8", "K14"})
      truth.erase(name);
  }
  const double inertia = read.or_else("mechanics.inertia_kgm2", 0.0);
  const bool alone = read.or_else("mechanics.load_inertia_kgm2", 0.0) == 0.0 &&
                     read.or_else("mechanics.load_viscous_friction_nms", 0.0) == 0.0;
  if (!(inertia > 0.0) || !alone) return truth;
  const double friction = read.or_else("mechanics.viscous_friction_nms", 0.0);
  truth.emplace("J", inertia);
  truth.emplace("f", friction);
  if (kind == MotorKind::kInduction) truth.emplace("K16", read.or_else("machine.pole_pairs", 1.0) / inertia);
  return truth;
}

void add_load_truth(const MeasuredData& data, const Settings& e, Truth& truth) {
  const auto inertia = truth.find("J");
  const auto friction = truth.find("f");
  if (e.kind != MotorKind::kInduction || inertia == truth.end()) return;
  const Column* const column = data.find("load_nm");
  if (e.load == LoadModel::kViscous) {
    if (friction != truth.end()) truth.emplace("K17", friction->second / inertia->second);
    return;
  }
  if (column == nullptr || friction == truth.end() || friction->second != 0.0) return;
  const SampleRange range = window_of(data, e.processing);
  const SeriesView load = SeriesView(column->values).subspan(range.first, range.count());
  const auto [least, most] = std::ranges::minmax_element(load);
  if (*most - *least > 1e-9 * std::abs(*most)) return;
  truth.emplace("tau_L", *most);
  truth.emplace("K17", *most / inertia->second);
}

}  // namespace drivebench::identification
