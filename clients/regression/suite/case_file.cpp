#include "clients/regression/suite/case_file.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <set>
#include <system_error>

#include "clients/regression/checks/check_reader.hpp"
#include "clients/regression/suite/matrix.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace fs = std::filesystem;
namespace {

constexpr double kLongestCase_s = 1e6;

/// `{a = {b = 1.0}}` as `a.b = 1.0`, as gains are named.
void flatten(const ConfigNode& table, const std::string& prefix, KeyTable& gains, DeviceUnderTest& device) {
  for (const ConfigNode& child : table.children) {
    const std::string name = prefix + child.key;
    const std::optional<double> value = number_in(child);
    if (child.kind == ConfigNode::Kind::kTable) {
      flatten(child, name + ".", gains, device);
    } else if (value) {
      device.gains.emplace_back(name, *value);
    } else {
      gains.report(name, "is " + described(child) + " but must be a finite number");
    }
  }
}

void read_link(KeyTable& table, DeviceUnderTest& device) {
  using Link = DeviceUnderTest::Link;
  static constexpr auto kWords =
      std::to_array<std::pair<std::string_view, Link>>({{"unix", Link::kUnix},
                                                        {"tcp", Link::kTcp},
                                                        {"shm", Link::kSharedMemory},
                                                        {"can", Link::kCan},
                                                        {"modbus", Link::kModbus}});
  const auto word = table.text("link");
  if (!word) return;
  if (device.kind != DeviceUnderTest::Kind::kProgram) table.report("link", "belongs to a command");
  const auto found = std::ranges::find(kWords, *word, &std::pair<std::string_view, Link>::first);
  if (found != kWords.end()) {
    device.link = found->second;
  } else {
    table.report("link",
                 fmt::format("is \"{}\" but must be \"unix\", \"tcp\", \"shm\", \"can\" or \"modbus\"",
                             printable(*word)));
  }
}

DeviceUnderTest read_device(KeyTable& table) {
  DeviceUnderTest device;
  device.line = table.line();
  const auto preset = table.text("preset");
  const ConfigNode* const gains = table.node("gains");
  device.command = table.texts("command");
  device.axis = table.text("axis").value_or("0");
  device.time_limit_s = table.number("time_limit_s", 0.1, 86'400.0).value_or(device.time_limit_s);
  if (preset) {
    device.kind = DeviceUnderTest::Kind::kPreset;
    device.preset = *preset;
  } else if (table.has("command")) {
    device.kind = DeviceUnderTest::Kind::kProgram;
  } else {
    table.require("preset");
  }
  if (preset && table.has("command")) table.report("command", "cannot stand beside preset");
  read_link(table, device);
  if (gains != nullptr && !preset) table.report("gains", "belongs to a preset");
  if (gains != nullptr) {
    if (auto inner = table.table("gains")) flatten(*gains, "", *inner, device);
  }
  table.finish();
  return device;
}

/// What a check needs of a multisine; the bench judges the values.
std::optional<Excitation> read_multisine(KeyTable& table, Step& step) {
  std::optional<KeyTable> inner = table.table("multisine");
  if (!inner) return std::nullopt;
  step.multisine = *table.node("multisine");
  const auto load_nm = inner->number("load_nm");
  const auto offset_a = inner->number("current_offset_a");
  if (inner->has("load_nm") == inner->has("current_offset_a")) {
    inner->report("load_nm", "or else current_offset_a must stand in a multisine");
  }
  for (const std::string_view key : {"period_s", "periods", "from_hz", "to_hz"})
    inner->require(key);
  const auto period_s = inner->number("period_s", 0.0);
  const auto periods = inner->integer("periods", 1, kMostMultisinePeriods);
  const auto from_hz = inner->number("from_hz", 0.0);
  const auto to_hz = inner->number("to_hz", 0.0);
  const auto ratio = inner->number("ratio", kLeastMultisineRatio, kMostMultisineRatio);
  inner->finish();
  if ((!load_nm && !offset_a) || !period_s || !periods || !from_hz || !to_hz) return std::nullopt;
  return Excitation{.is_load = load_nm.has_value(),
                    .amplitude = load_nm.value_or(offset_a.value_or(0.0)),
                    .begin_s = step.at_s.value_or(step.delay_s),
                    .has_trigger = step.when.has_value(),
                    .period_s = *period_s,
                    .periods = static_cast<double>(*periods),
                    .from_hz = *from_hz,
                    .to_hz = *to_hz,
                    .ratio = ratio.value_or(kDefaultMultisineRatio)};
}

/// Exactly one of the actions. The value of a parameter or a fault is for the bench to judge.
void read_action(KeyTable& table, Step& step) {
  struct Row {
    std::string_view key;
    Step::Action action;
  };
  static constexpr auto kActions = std::to_array<Row>({{"load_nm", Step::Action::kLoad},
                                                       {"parameter", Step::Action::kParameter},
                                                       {"fault", Step::Action::kFault},
                                                       {"impulse_nms", Step::Action::kImpulse},
                                                       {"multisine", Step::Action::kMultisine}});
  const bool has_name = table.has("parameter") || table.has("fault");
  std::size_t count = 0;
  for (const Row& row : kActions) {
    if (!table.has(row.key)) {
      table.node(row.key);  // a key that may stand here
      continue;
    }
    ++count;
    step.action = row.action;
    if (row.action == Step::Action::kMultisine) {
      step.excitation = read_multisine(table, step);
    } else if (row.action == Step::Action::kParameter || row.action == Step::Action::kFault) {
      step.name = table.text(row.key).value_or("");
    } else if (table.number(row.key)) {
      step.value = *table.node(row.key);
    }
  }
  if (count != 1) {
    table.report("load_nm",
                 fmt::format("is one of load_nm, parameter, fault, impulse_nms and multisine, of which a "
                             "step has exactly one; here are {}",
                             count));
  }
  const ConfigNode* const value = table.node("value");
  if (has_name) table.require("value");
  if (value == nullptr) return;
  if (!has_name) table.report("value", "belongs to parameter and fault");
  if (value->kind != ConfigNode::Kind::kScalar) table.report("value", "must be a single value");
  step.value = *value;
}

Step read_step(KeyTable& table) {
  Step step;
  step.line = table.line();
  step.axis = table.text("axis").value_or("0");
  step.at_s = table.number("at_s", 0.0, kLongestCase_s);
  step.when = read_condition(table, "when");
  if (table.has("at_s") == table.has("when")) {
    table.report("at_s", "or else when must stand in a step: a time, or a condition");
  }
  step.for_s = table.number("for_s", 0.0, kLongestCase_s).value_or(0.0);
  step.delay_s = table.number("delay_s", 0.0, kLongestCase_s).value_or(0.0);
  for (const std::string_view key : {"for_s", "delay_s"}) {
    if (table.has(key) && !table.has("when")) table.report(key, "belongs to when");
  }
  read_action(table, step);
  step.ramp_s = table.number("ramp_s", 0.0, kLongestCase_s).value_or(0.0);
  if (table.has("ramp_s") && !table.has("load_nm") && !table.has("parameter")) {
    table.report("ramp_s", "belongs to load_nm and parameter");
  }
  table.finish();
  return step;
}

/// The step of a case whose multisine a check is about; null after a problem.
const Step* exciting_step(KeyTable& root, const Case& c, const CheckSpec& check) {
  const auto excites = [](const Step& step) { return step.action == Step::Action::kMultisine; };
  const auto report = [&](const std::string& rule) {
    root.report("check", fmt::format("\"{}\" (line {}) {}", check.name, check.line, rule));
    return nullptr;
  };
  if (check.step) {
    if (*check.step < c.steps.size() && excites(c.steps[*check.step])) return &c.steps[*check.step];
    return report(fmt::format("has step {}, which is no step with a multisine", *check.step));
  }
  const auto count = std::ranges::count_if(c.steps, excites);
  if (count == 1) return &*std::ranges::find_if(c.steps, excites);
  return report(count == 0 ? "needs a step with a multisine"
                           : "needs the number of its step, because several have a multisine");
}

/// Whether a step beside this one changes the offset of the current sensors of its axis.
bool changes_offset_again(const Case& c, const Step& exciting) {
  return std::ranges::any_of(c.steps, [&exciting](const Step& step) {
    const bool is_offset = (step.excitation && !step.excitation->is_load) ||
                           (step.action == Step::Action::kFault && step.name == "current_sensor_offset");
    return &step != &exciting && step.axis == exciting.axis && is_offset;
  });
}

/// Gives a check the multisine of its step, the axis of the step, and without a window of its own that from
/// the second period of the multisine to its end.
void excite(KeyTable& root, const Case& c, CheckSpec& check) {
  const Step* const step = exciting_step(root, c, check);
  if (step == nullptr || !step->excitation) return;
  const Excitation& excitation = *step->excitation;
  check.excitation = excitation;
  check.axis = step->axis;
  const auto report = [&](std::string_view rule) {
    root.report("check", fmt::format("\"{}\" (line {}) {}", check.name, check.line, rule));
  };
  if (!excitation.is_load && changes_offset_again(c, *step)) {
    report("has a second step that changes the offset of the current sensors, so that it is not known");
  }
  if (step->when && !excitation.is_load && check.has_window) {
    report("cannot have a window of its own: its step begins on a condition");
  }
  if (check.has_window) return;
  if (step->for_s > 0.0) return report("cannot find its step, which has for_s");
  check.after = step->when;
  check.from_s = excitation.begin_s + excitation.period_s;
  check.to_s = excitation.begin_s + excitation.periods * excitation.period_s;
}

void refuse_equal_names(KeyTable& root, const std::vector<CheckSpec>& checks) {
  std::set<std::string_view> names;
  for (const CheckSpec& check : checks) {
    if (names.insert(check.name).second) continue;
    root.report("check", fmt::format("has two of the name \"{}\" (line {}): give each a name", check.name,
                                     check.line));
  }
}

/// The rules between the parts of a case.
void check_whole(KeyTable& root, const Case& c) {
  using enum DeviceUnderTest::Kind;
  if (c.device.kind == kNone && !c.duration_s) root.require("duration_s");
  if (c.is_realtime && c.device.kind == kPreset) {
    root.report("mode", "is \"realtime\", but a preset runs in lockstep");
  }
  if (c.checks.empty() && c.skip.empty())
    root.report("check", "is missing: a case without checks proves nothing");
  refuse_equal_names(root, c.checks);
}

Case read_case(const ConfigNode& node, const fs::path& file, const std::string& name, ProblemList& problems) {
  const std::string path = file.string();
  KeyTable root(node, "", 1, path, problems);
  Case c{.name = name, .file = path, .bench = {}};
  root.require("bench");
  c.bench = root.text("bench").value_or("");
  root.text("about");
  c.seed = root.node("seed") != nullptr ? root.integer("seed", 0, kMostSeed) : std::nullopt;
  c.duration_s = root.number("duration_s", 1e-6, kLongestCase_s);
  if (const auto mode = root.text("mode")) {
    c.is_realtime = *mode == "realtime";
    if (!c.is_realtime && *mode != "lockstep") {
      root.report("mode", "is \"" + *mode + "\" but must be \"lockstep\" or \"realtime\"");
    }
  }
  c.skip = root.text("skip").value_or("");
  c.tags = root.texts("tags");
  if (auto device = root.table("dut")) c.device = read_device(*device);
  if (root.table("override")) c.overrides = *root.node("override");
  for (KeyTable& step : root.tables("step"))
    c.steps.push_back(read_step(step));
  for (KeyTable& table : root.tables("check")) {
    auto check = read_check(table, file.parent_path());
    if (!check) continue;
    if (check->axis.empty()) check->axis = c.device.axis;
    c.checks.push_back(std::move(*check));
  }
  for (CheckSpec& check : c.checks) {
    if (check.kind->watches == Watches::kResponse) excite(root, c, check);
  }
  check_whole(root, c);
  root.finish();
  return c;
}

std::string with_values(const std::string& name,
                        const std::vector<std::pair<std::string, std::string>>& values) {
  std::string text;
  for (const auto& [label, value] : values)
    text += fmt::format("{}{}={}", text.empty() ? "" : ", ", label, value);
  return text.empty() ? name : fmt::format("{}[{}]", name, text);
}

/// Whether there were problems; they are in the other list now.
bool moved(ProblemList& from, ProblemList& to) {
  try {
    from.throw_if_any();
  } catch (const ConfigError& error) {
    for (const ConfigProblem& each : error.problems())
      to.add(each.file, each.line, each.key, each.rule);
    return true;
  }
  return false;
}

/// The cases of a file; `name` is that of the file within its suite. Problems go to the list.
void visit_case_file(const fs::path& file, const std::string& name, ProblemList& problems,
                     const SeeCase& see) {
  const std::string path = file.string();
  const FileText content = read_file(file, kMaxConfigBytes);
  if (!content.why_not.empty()) {
    problems.add(path, 0, "", content.why_not);
    return;
  }
  const std::optional<ConfigNode> root = parse_document(content.text, path, problems);
  if (!root) return;
  ProblemList found;
  const Matrix matrix(*root, path, found);
  if (moved(found, problems)) return;
  for (std::size_t i = 0; i < matrix.size(); ++i) {
    auto values = matrix.values_at(i);
    const ConfigNode whole = matrix.at(i, *root, path, found);
    Case c = read_case(whole, file, with_values(name, values), found);
    if (moved(found, problems)) return;  // the other combinations would tell most of it again
    c.values = std::move(values);
    see(std::move(c));
  }
}

}  // namespace

void visit_suite(const fs::path& suite, const SeeCase& see) {
  ProblemList problems;
  std::vector<std::pair<std::string, fs::path>> files;
  std::error_code error;
  if (fs::is_directory(suite, error)) {
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(suite, error)) {
      const fs::path& file = entry.path();
      if (file.extension() != ".toml") continue;
      files.emplace_back(fs::relative(file, suite).replace_extension().generic_string(), file);
    }
    if (error) problems.add(suite.string(), 0, "", "cannot be read: " + error.message());
    if (files.empty()) problems.add(suite.string(), 0, "", "has no cases: no file ends with .toml");
  } else {
    files.emplace_back(suite.stem().string(), suite);
  }
  std::ranges::sort(files);
  for (const auto& [name, file] : files)
    visit_case_file(file, name, problems, see);
  problems.throw_if_any();
}

ConfigNode table_of(const Case& c) {
  ProblemList problems;
  const FileText content = read_file(c.file, kMaxConfigBytes);
  if (!content.why_not.empty()) problems.add(c.file, 0, "", content.why_not);
  const std::optional<ConfigNode> root =
      content.why_not.empty() ? parse_document(content.text, c.file, problems) : std::nullopt;
  problems.throw_if_any();
  const Matrix matrix(*root, c.file, problems);
  problems.throw_if_any();
  for (std::size_t i = 0; i < matrix.size(); ++i) {
    if (matrix.values_at(i) == c.values) return matrix.at(i, *root, c.file, problems);
  }
  problems.add(c.file, 0, "", "has changed: it has no case of these values");
  problems.throw_if_any();
  return {};
}

Case case_in(const ConfigNode& table, const fs::path& file, const std::string& name) {
  ProblemList problems;
  Case c = read_case(table, file, name, problems);
  problems.throw_if_any();
  return c;
}

std::vector<Case> read_suite(const fs::path& suite) {
  std::vector<Case> cases;
  visit_suite(suite, [&cases](Case c) { cases.push_back(std::move(c)); });
  return cases;
}

}  // namespace drivebench::regression
