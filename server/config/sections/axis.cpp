#include "server/config/sections/axis.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "plant/parameters/drive_rows.hpp"
#include "protocols/text.hpp"
#include "server/bench/terminals.hpp"
#include "server/config/sections/events.hpp"
#include "server/config/sections/parameters.hpp"
#include "server/config/words.hpp"

namespace drivebench {
namespace {

constexpr std::int64_t kMaxTicks = 1'000'000'000'000'000;
constexpr double kMaxSeconds = 1e9;
constexpr double kQuickStopS = 0.5;
constexpr double kMaxSlewPerS = 1e9;
constexpr std::string_view kSharesShaft = "shares_shaft_with";
constexpr std::string_view kSharesAmplifier = "shares_amplifier_with";

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

using Shared = std::optional<std::size_t> AxisSetup::*;

bool is_shared(std::span<const AxisReading> axes, Shared member, std::size_t index) {
  return std::ranges::any_of(
      axes, [&](const AxisReading& other) { return other.setup.*member == std::optional(index); });
}

/// The axis with which this one shares its `what`.
std::optional<std::size_t> read_partner(StrictTable& axis, std::string_view key, std::string_view what,
                                        Shared member, std::span<const AxisReading> before) {
  const auto name = axis.identifier(key);
  if (!name) return std::nullopt;
  const auto partner = std::ranges::find(
      before, *name, [](const AxisReading& other) -> const std::string& { return other.config.name; });
  const auto index = static_cast<std::size_t>(partner - before.begin());
  const std::string what_it_is(what);
  if (partner == before.end()) {
    axis.report(key, "is \"" + printable(*name) + "\" but no axis above this one has that name");
  } else if (partner->setup.*member) {
    axis.report(key, "is \"" + *name + "\", which has no " + what_it_is + " of its own");
  } else if (is_shared(before, member, index)) {
    axis.report(key, "is \"" + *name + "\", whose " + what_it_is + " another axis shares already");
  } else {
    return index;
  }
  return std::nullopt;
}

/// An axis takes part in a pair on one shaft or in one on an amplifier, not in both.
bool is_single(StrictTable& axis, std::string_view key, std::span<const AxisReading> before,
               std::size_t partner, Shared member, std::string_view what) {
  if (!(before[partner].setup.*member) && !is_shared(before, member, partner)) return true;
  axis.report(key, "is \"" + before[partner].config.name + "\", which shares its " + std::string(what) +
                       " with another axis");
  return false;
}

Connection connection_of(const AxisParameters& p) {
  return terminals_of(p).connection;
}

/// Whether the machine fits to the amplifier of the other axis, with which it is in parallel.
void check_shared_amplifier(StrictTable& axis, const AxisParameters& p, const AxisReading& partner) {
  const std::string start = "is \"" + partner.config.name + "\", ";
  if (connection_of(p) != connection_of(partner.setup.parameters)) {
    axis.report(kSharesAmplifier, start + "whose windings are connected differently");
  }
  std::vector<Problem> sentences;
  Problems found(sentences);
  add_shared_problems(partner.setup.parameters.drive, found);
  for (const AxisEvent& event : partner.config.events) {
    const auto* const write = std::get_if<ParameterWrite>(&event.action);
    if (write == nullptr || !sentences.empty()) continue;
    AxisParameters then = partner.setup.parameters;
    axis_parameters(then)[write->row].set(then, write->value);
    add_shared_problems(then.drive, found);
  }
  for (const Problem& problem : sentences)
    axis.report(kSharesAmplifier, start + "whose " + problem.field + " " + problem.rule);
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

/// The safe action and the rules of commands: those of the amplifier.
void read_commands(StrictTable& axis, std::int64_t period_ns, bool shares_amplifier, AxisSetup& setup) {
  if (shares_amplifier) {
    for (const std::string_view key :
         {"on_link_loss", "quick_stop_s", "quick_stop_ticks", "on_excess", "slew_per_s"}) {
      if (!axis.has(key)) continue;
      axis.report(key, "cannot stand beside shares_amplifier_with: the commands are those of the other axis");
    }
  }
  const auto action = axis.choice("on_link_loss", kSafeActionWords);
  setup.on_link_loss = static_cast<SafeAction>(action.value_or(0));
  setup.quick_stop_ticks = read_quick_stop(axis, period_ns);
  const auto excess = axis.choice("on_excess", kOnExcessWords);
  setup.rules = {.on_excess = static_cast<OnExcess>(excess.value_or(0)),
                 .slew_per_s = axis.real("slew_per_s", 0.0, kMaxSlewPerS).value_or(0.0)};
}

}  // namespace

AxisReading read_axis(StrictTable& axis, const std::filesystem::path& folder, std::int64_t period_ns,
                      std::span<const std::string> names, std::span<const AxisReading> before,
                      ProblemList& problems, std::vector<ConfigProblem>& odd) {
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

  auto partner = read_partner(axis, kSharesShaft, "shaft", &AxisSetup::shares_shaft_with, before);
  auto other = read_partner(axis, kSharesAmplifier, "amplifier", &AxisSetup::shares_amplifier_with, before);
  const bool shares_shaft = axis.has(kSharesShaft);
  const bool shares_amplifier = axis.has(kSharesAmplifier);
  if (shares_shaft && shares_amplifier) {
    axis.report(kSharesAmplifier, "cannot stand beside shares_shaft_with");
    other.reset();
  }
  if (partner &&
      !is_single(axis, kSharesShaft, before, *partner, &AxisSetup::shares_amplifier_with, "amplifier"))
    partner.reset();
  if (other && !is_single(axis, kSharesAmplifier, before, *other, &AxisSetup::shares_shaft_with, "shaft"))
    other.reset();
  result.setup.shares_shaft_with = partner;
  result.setup.shares_amplifier_with = other;
  AxisParameters& p = result.setup.parameters;
  const MechanicsParameters no_mechanics;
  const DriveParameters no_drive;
  const ParameterSource source{.axis = axis,
                               .motor = motor,
                               .motor_missing = axis.has("motor") && !motor.table,
                               .folder = folder,
                               .odd = odd,
                               .shared_mechanics = partner ? &before[*partner].setup.parameters.mechanics
                                                   : shares_shaft ? &no_mechanics
                                                                  : nullptr,
                               .shared_drive = other              ? &before[*other].setup.parameters.drive
                                               : shares_amplifier ? &no_drive
                                                                  : nullptr};
  const bool partner_valid = (partner ? before[*partner].parameters_valid : !shares_shaft) &&
                             (other ? before[*other].parameters_valid : !shares_amplifier);
  result.parameters_valid = read_parameters(source, problems, p) && partner_valid;
  if (other && result.parameters_valid) check_shared_amplifier(axis, p, before[*other]);

  read_commands(axis, period_ns, shares_amplifier, result.setup);
  const auto node = axis.integer("can_node", 1, can::kMaxNode);
  result.config.can_node =
      static_cast<std::uint32_t>(node.value_or(static_cast<std::int64_t>(before.size()) + 1));
  result.config.events = read_events(axis, result.parameters_valid ? &p : nullptr,
                                     {.shaft = shares_shaft, .drive = shares_amplifier},
                                     {.axis = before.size(), .names = names, .period_ns = period_ns});
  axis.finish();
  return result;
}

}  // namespace drivebench
