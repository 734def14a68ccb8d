#include "clients/command/identify/data/identify_steps.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string_view>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "protocols/document.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {

using identification::LoadModel;
using identification::MotorName;
using identification::NamedExperiment;
using identification::Settings;

namespace {

double seconds_in(std::string_view text, const std::string& whole) {
  const auto value = finite_number(text);
  if (!value || *value < 0.0)
    throw UsageError(
        fmt::format("--window '{}' should be FROM:TO in seconds, 0.005:0.2 for example", printable(whole)));
  return *value;
}

void set_window(const std::string& text, identification::Processing& p) {
  const std::size_t colon = text.find(':');
  const std::string_view view = text;
  p.from_s = seconds_in(view.substr(0, colon), text);
  if (colon != std::string::npos && colon + 1 < text.size())
    p.to_s = seconds_in(view.substr(colon + 1), text);
  if (p.to_s > 0.0 && p.to_s <= p.from_s)
    throw UsageError(fmt::format("--window '{}' ends before it begins", printable(text)));
}

}  // namespace

void apply_options(const IdentifyOptions& o, Settings& e) {
  identification::Processing& p = e.processing;
  if (o.pole_pairs) e.pole_pairs = *o.pole_pairs;
  if (o.counts_per_revolution) e.counts_per_revolution = *o.counts_per_revolution;
  if (o.phases) e.three_phase = *o.phases == 3;
  e.reversed = o.direction == "reversed";
  if (!o.voltages.empty()) p.voltage_shift = o.voltages == "mean" ? 0.5 : 0.0;
  if (o.voltage_shift) p.voltage_shift = *o.voltage_shift;
  if (!o.window.empty()) set_window(o.window, p);
  if (o.current_hz) p.current.cutoff_hz = *o.current_hz;
  if (o.voltage_hz) p.voltage.cutoff_hz = *o.voltage_hz;
  if (o.shaft_hz) p.shaft.cutoff_hz = *o.shaft_hz;
  if (o.order) p.current.order = p.voltage.order = p.shaft.order = *o.order;
  if (!o.load.empty()) e.load = o.load == "constant" ? LoadModel::kConstant : LoadModel::kViscous;
  if (o.one_stage) e.two_stage = false;
  const auto finds = [&](const char* what) { return std::ranges::find(o.find, what) != o.find.end(); };
  e.sensors = {.current_offsets = finds("current-offsets"),
               .voltage_offsets = finds("voltage-offsets"),
               .gains = finds("gains")};
}

namespace {

/// Whether the bench loads the shaft from tick 0 to the end; sample 0 is taken before.
bool has_load(const identification::MeasuredData& data) {
  const identification::Column* const load = data.find("load_nm");
  return load != nullptr && load->values.size() > 1 &&
         std::find(load->values.begin() + 1, load->values.end(), 0.0) == load->values.end();
}

}  // namespace

const MotorName& chosen_motor(const std::string& name) {
  const std::string names = listed(identification::kMotorNames, &MotorName::name);
  if (name.empty()) throw UsageError("--motor is missing; there are " + names);
  const MotorName* const motor = identification::find_motor(name);
  if (motor == nullptr)
    throw UsageError(fmt::format("--motor '{}' is not known{}; there are {}", printable(name),
                                 did_you_mean(name, identification::kMotorNames, &MotorName::name), names));
  return *motor;
}

WantedExperiment wanted_experiment(const MotorName& motor, const NamedExperiment* named,
                                   const std::string& choice) {
  try {
    const std::filesystem::path file =
        find_experiment_file(named != nullptr ? std::string(named->file) : choice);
    return {.file = load_experiment(file),
            .bench = named != nullptr ? std::string(named->bench) : std::string(),
            .machine = motor.machine};
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

Settings settings_for(const IdentifyOptions& options, const MotorName& motor, const NamedExperiment* named,
                      const MeasuredMotor& m) {
  Settings e = settings_of(motor.kind, m.facts, m.data.period_s);
  if (m.drive.empty())
    e.processing.voltage_shift = usual_processing(motor.kind, m.data.period_s).voltage_shift;
  if (named != nullptr) {
    apply(*named, e);
  } else if (has_load(m.data)) {
    e.load = LoadModel::kConstant;
  }
  if (m.bench.empty() && m.data.find("encoder_count") == nullptr) e.counts_per_revolution = 0.0;
  apply_options(options, e);
  const bool given = options.shaft_hz || options.current_hz || options.voltage_hz ||
                     (named != nullptr && named->shaft_hz > 0.0);
  if (!given) choose_shaft_filter(m.data, e);
  return e;
}

void compare(const MeasuredMotor& m, const Settings& e, identification::Result& result) {
  auto truth = truth_of(e.kind, m.bench);
  if (truth.empty()) return;
  add_load_truth(m.data, e, truth);
  result.compare(truth);
}

}  // namespace drivebench::command
