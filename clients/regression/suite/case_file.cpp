#include "clients/regression/suite/case_file.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <set>
#include <system_error>

#include "clients/regression/checks/check_reader.hpp"
#include "clients/regression/suite/device_reader.hpp"
#include "clients/regression/suite/matrix.hpp"
#include "clients/regression/suite/step_reader.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace fs = std::filesystem;
namespace {

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

/// A device under test must be there for a message, and hear it.
void check_message(KeyTable& root, const DeviceUnderTest& device, const Step& step) {
  using enum DeviceUnderTest::Kind;
  if (step.message.key.empty()) return;  // it has a problem already
  const auto report = [&](std::string_view rule) {
    root.report("step", fmt::format("of line {} has {}, which {}", step.line, step.message.key, rule));
  };
  if (step.message.key == "line") {
    if (device.kind != kProgram) report("belongs to a command: it goes to the standard input of the program");
  } else if (device.kind != kProgram && device.kind != kAttached) {
    report("belongs to a command or an attached drive");
  } else if (step.message.key == "can" && device.link != DeviceUnderTest::Link::kCan) {
    report("needs the device under test on a CAN bus");
  }
}

/// The rules between the parts of a case.
void check_whole(KeyTable& root, const Case& c) {
  using enum DeviceUnderTest::Kind;
  if ((c.device.kind == kNone || c.device.kind == kAttached) && !c.duration_s) root.require("duration_s");
  if (c.device.kind == kAttached && !c.is_realtime) {
    root.report("mode", "must be \"realtime\": an attached drive waits for no bench");
  }
  if (c.is_realtime && c.device.kind == kPreset) {
    root.report("mode", "is \"realtime\", but a preset runs in lockstep");
  }
  for (const CheckSpec& check : c.checks) {
    if (!check.reference.empty() && c.is_realtime)
      root.report("check", fmt::format("\"{}\" (line {}) has a reference, which runs in lockstep", check.name,
                                       check.line));
  }
  for (const Step& step : c.steps) {
    if (step.action == Step::Action::kMessage) check_message(root, c.device, step);
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

/// The names of the cases of a suite. Results and bundles are files of these names, where a '/' is a '_'.
class Names {
 public:
  /// False: it is taken already.
  bool take(std::string name) {
    std::ranges::replace(name, '/', '_');
    return taken_.insert(std::move(name)).second;
  }

 private:
  std::set<std::string> taken_;
};

/// The cases of a file; `name` is that of the file within its suite. Problems go to the list.
void visit_case_file(const fs::path& file, const std::string& name, Names& names, ProblemList& problems,
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
    if (!names.take(c.name)) {
      problems.add(
          path, c.line, "",
          fmt::format(
              "makes a second case of the name \"{}\"{}", printable(c.name),
              c.name.find_first_of("/_") == std::string::npos ? "" : ", where / and _ count as the same"));
      return;
    }
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
  Names names;
  for (const auto& [name, file] : files)
    visit_case_file(file, name, names, problems, see);
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
