#include "server/config/sections/axis.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "protocols/text.hpp"
#include "server/config/sections/events.hpp"
#include "server/config/sections/parameters.hpp"
#include "server/config/words.hpp"

namespace drivebench {
namespace {

constexpr std::int64_t kMaxTicks = 1'000'000'000'000'000;
constexpr double kMaxSeconds = 1e9;
constexpr double kQuickStopS = 0.5;
constexpr double kMaxSlewPerS = 1e9;

void read_motor_file(StrictTable& axis, const std::string& motor, const std::filesystem::path& folder,
                     ProblemList& problems, MotorFile& result) {
  if (folder.empty()) {
    axis.report("motor", std::string(kNoOtherFiles));
    return;
  }
  const std::filesystem::path path = (folder / motor).lexically_normal();
  result.path = path.string();
  result.folder = path.parent_path();
  const FileText file = read_file(result.path, kMaxConfigBytes);
  if (!file.why_not.empty()) {
    axis.report("motor", "names " + result.path + ", which " + file.why_not);
    return;
  }
  result.document = parse_document(file.text, result.path, problems);
  if (!result.document) return;
  StrictTable& table = result.table.emplace(&*result.document, "", 1, result.path, problems);
  table.require("name");
  table.require("source");
  result.name = table.text("name", 200).value_or("");
  table.text("source", 800);
}

/// The axis whose shaft this one shares.
std::optional<std::size_t> read_partner(StrictTable& axis, std::span<const AxisReading> before) {
  constexpr std::string_view kKey = "shares_shaft_with";
  const auto name = axis.identifier(kKey);
  if (!name) return std::nullopt;
  const auto partner = std::find_if(before.begin(), before.end(),
                                    [&](const AxisReading& other) { return other.config.name == *name; });
  const auto index = static_cast<std::size_t>(partner - before.begin());
  if (partner == before.end()) {
    axis.report(kKey, "is \"" + printable(*name) + "\" but no axis above this one has that name");
  } else if (partner->setup.shares_shaft_with) {
    axis.report(kKey, "is \"" + *name + "\", which has no shaft of its own");
  } else if (std::any_of(before.begin(), before.end(),
                         [&](const AxisReading& other) { return other.setup.shares_shaft_with == index; })) {
    axis.report(kKey, "is \"" + *name + "\", whose shaft another axis shares already");
  } else {
    return index;
  }
  return std::nullopt;
}

}  // namespace

std::optional<Tick> read_ticks(StrictTable& table, std::string_view seconds_key, std::string_view ticks_key,
                               std::int64_t period_ns) {
  const auto seconds = table.real(seconds_key, 0.0, kMaxSeconds);
  const auto ticks = table.integer(ticks_key, 0, kMaxTicks);
  if (table.has(seconds_key) && table.has(ticks_key)) {
    table.report(ticks_key, "cannot stand beside " + std::string(seconds_key));
  }
  if (!seconds) return ticks;
  return std::llround(*seconds * 1e9 / static_cast<double>(period_ns));
}

namespace {

Tick read_quick_stop(StrictTable& axis, std::int64_t period_ns) {
  const Tick by_default = std::llround(kQuickStopS * 1e9 / static_cast<double>(period_ns));
  const Tick ticks = read_ticks(axis, "quick_stop_s", "quick_stop_ticks", period_ns)
                         .value_or(std::clamp(by_default, Tick{1}, kMaxQuickStop));
  if (ticks >= 1 && ticks <= kMaxQuickStop) return ticks;
  axis.report(
      axis.has("quick_stop_s") ? "quick_stop_s" : "quick_stop_ticks",
      "comes to " + std::to_string(ticks) + " ticks but must come to 1 to " + std::to_string(kMaxQuickStop));
  return 1;
}

}  // namespace

AxisReading read_axis(StrictTable& axis, const std::filesystem::path& folder, std::int64_t period_ns,
                      std::span<const AxisReading> before, ProblemList& problems,
                      std::vector<ConfigProblem>& odd) {
  AxisReading result;
  axis.require("name");
  result.config.name = axis.identifier("name").value_or("");

  MotorFile motor;
  const auto motor_path = axis.text("motor", 800);
  motor.name = axis.text("motor_name", 200).value_or("");
  if (axis.has("motor") && axis.has("motor_name")) {
    axis.report("motor_name", "cannot stand beside motor: the motor file has a name");
  }
  if (motor_path) read_motor_file(axis, *motor_path, folder, problems, motor);
  result.config.motor = motor.name;

  const auto partner = read_partner(axis, before);
  result.setup.shares_shaft_with = partner;
  const bool shares_shaft = axis.has("shares_shaft_with");
  AxisParameters& p = result.setup.parameters;
  const MechanicsParameters none;
  const ParameterSource source{.axis = axis,
                               .motor = motor,
                               .motor_missing = axis.has("motor") && !motor.table,
                               .folder = folder,
                               .odd = odd,
                               .shared_mechanics = partner ? &before[*partner].setup.parameters.mechanics
                                                   : shares_shaft ? &none
                                                                  : nullptr};
  const bool shaft_valid = partner ? before[*partner].parameters_valid : !shares_shaft;
  result.parameters_valid = read_parameters(source, problems, p) && shaft_valid;

  const auto action = axis.choice("on_link_loss", kSafeActionWords);
  result.setup.on_link_loss = static_cast<SafeAction>(action.value_or(0));
  result.setup.quick_stop_ticks = read_quick_stop(axis, period_ns);
  const auto excess = axis.choice("on_excess", kOnExcessWords);
  result.setup.rules = {.on_excess = static_cast<OnExcess>(excess.value_or(0)),
                        .slew_per_s = axis.real("slew_per_s", 0.0, kMaxSlewPerS).value_or(0.0)};
  const auto node = axis.integer("can_node", 1, can::kMaxNode);
  result.config.can_node =
      static_cast<std::uint32_t>(node.value_or(static_cast<std::int64_t>(before.size()) + 1));
  result.config.events = read_events(axis, result.parameters_valid ? &p : nullptr, shares_shaft, period_ns);
  axis.finish();
  return result;
}

}  // namespace drivebench
