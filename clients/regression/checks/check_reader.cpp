#include "clients/regression/checks/check_reader.hpp"

#include <fmt/core.h>

#include <algorithm>

#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

constexpr double kLatest_s = 1e9;
constexpr std::int64_t kMostSteps = 1000;

const CheckKind* read_kind(KeyTable& table) {
  table.require("kind");
  const std::optional<std::string> name = table.text("kind");
  if (!name) return nullptr;
  const auto kinds = check_kinds();
  const auto found = std::ranges::find(kinds, *name, &CheckKind::name);
  if (found != kinds.end()) return &*found;
  table.report("kind", fmt::format("is \"{}\", no kind of check{}", printable(*name),
                                   advice(*name, kinds, &CheckKind::name)));
  return nullptr;
}

const Signal* read_signal(KeyTable& table) {
  table.require("signal");
  const std::optional<std::string> name = table.text("signal");
  const Signal* const signal = name ? find_signal(*name) : nullptr;
  if (name && signal == nullptr) {
    table.report("signal", fmt::format("is \"{}\", no signal of a bench{}", printable(*name),
                                       did_you_mean(*name, kSignals, &Signal::name)));
  }
  return signal;
}

/// A formula in the place of a signal.
void read_formula(KeyTable& table, CheckSpec& spec) {
  if (table.node("signal") != nullptr) table.report("formula", "cannot stand beside signal");
  const std::optional<std::string> text = table.text("formula");
  if (!text) return;
  auto parsed = Formula::parse(*text);
  if (const auto* const why = std::get_if<std::string>(&parsed))
    return table.report("formula", fmt::format("is \"{}\" but {}", printable(*text), *why));
  spec.formula = std::get<std::shared_ptr<const Formula>>(std::move(parsed));
  spec.signal = &spec.formula->label();
}

/// The keys of what the kind watches.
void read_watched(KeyTable& table, const std::filesystem::path& folder, CheckSpec& spec) {
  if (spec.kind->watches == Watches::kCondition) {
    table.require("condition");
    spec.condition = read_condition(table, "condition");
  } else if (spec.kind->watches == Watches::kFault) {
    table.require("fault");
    spec.fault = table.text("fault").value_or("");
  } else if (spec.kind->watches == Watches::kResponse) {
    if (table.has("signal")) spec.signal = read_signal(table);
    table.node("signal");  // may stand here
    if (const auto step = table.integer("step", 0, kMostSteps)) spec.step = static_cast<std::size_t>(*step);
  } else if (spec.kind->watches == Watches::kSignal && table.has("formula")) {
    read_formula(table, spec);
  } else {
    spec.signal = read_signal(table);
  }
  if (spec.kind->watches != Watches::kGolden) return;
  spec.reference = table.text("reference").value_or("");
  if (table.has("golden") == table.has("reference"))
    table.report("golden",
                 "or else reference must stand in a tube: a file, or a controller of `drivebench control`");
  if (const auto file = table.text("golden")) spec.golden_file = (folder / *file).lexically_normal().string();
}

bool is_complete(const CheckSpec& spec) {
  switch (spec.kind->watches) {
    case Watches::kCondition:
      return spec.condition.has_value();
    case Watches::kFault:
      return !spec.fault.empty();
    case Watches::kGolden:
      return spec.signal != nullptr && (!spec.golden_file.empty() || !spec.reference.empty());
    case Watches::kResponse:
      return true;
    case Watches::kSignal:
      break;
  }
  return spec.signal != nullptr;
}

void read_window(KeyTable& table, CheckSpec& spec) {
  spec.from_s = table.number("from_s", 0.0, kLatest_s).value_or(0.0);
  spec.to_s = table.number("to_s", 0.0, kLatest_s);
  spec.has_window = table.has("from_s") || table.has("after");
  if (spec.to_s && *spec.to_s < spec.from_s) {
    table.report("to_s",
                 fmt::format("is {:.6g} but must not lie before from_s, {:.6g}", *spec.to_s, spec.from_s));
  }
  if (spec.kind->needs_after) table.require("after");
  spec.after = read_condition(table, "after");
}

/// The name of a check that has none of its own.
std::string default_name(const CheckSpec& spec) {
  if (spec.condition) return fmt::format("{} {}", spec.kind->name, spec.condition->text);
  if (spec.signal != nullptr) return fmt::format("{} {}", spec.kind->name, spec.signal->name);
  if (!spec.fault.empty()) return fmt::format("{} {}", spec.kind->name, spec.fault);
  return std::string(spec.kind->name);
}

}  // namespace

std::optional<CaseCondition> read_condition(KeyTable& table, std::string_view key) {
  const std::optional<std::string> text = table.text(key);
  if (!text) return std::nullopt;
  const auto parsed = parse_condition(*text);
  if (const auto* const named = std::get_if<NamedCondition>(&parsed)) return CaseCondition{*text, *named};
  table.report(key, fmt::format("is \"{}\" but {}", printable(*text), std::get<std::string>(parsed)));
  return std::nullopt;
}

std::optional<CheckSpec> read_check(KeyTable& table, const std::filesystem::path& folder) {
  CheckSpec spec;
  spec.line = table.line();
  spec.kind = read_kind(table);
  if (spec.kind == nullptr) return std::nullopt;
  spec.name = table.text("name").value_or("");
  spec.axis = table.text("axis").value_or("");
  read_watched(table, folder, spec);
  read_window(table, spec);
  for (const NumberKey& key : spec.kind->keys) {
    if (key.required) table.require(key.name);
    if (const auto value = table.number(key.name, key.minimum, key.maximum)) {
      spec.numbers.emplace_back(key.name, *value);
    }
  }
  table.finish();
  if (!is_complete(spec)) return std::nullopt;
  if (spec.kind->problem != nullptr) {
    if (const std::string rule = spec.kind->problem(spec); !rule.empty()) table.report("kind", rule);
  }
  if (spec.name.empty()) spec.name = default_name(spec);
  return spec;
}

}  // namespace drivebench::regression
