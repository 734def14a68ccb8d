#include "clients/regression/suite/compose.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <utility>

#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace fs = std::filesystem;
namespace {

ConfigNode table_node(std::string key) {
  return {.key = std::move(key), .line = 0, .kind = Kind::kTable, .scalar = {}, .children = {}};
}

template <class Value>
ConfigNode scalar_node(std::string key, Value value) {
  return {
      .key = std::move(key), .line = 0, .kind = Kind::kScalar, .scalar = std::move(value), .children = {}};
}

ConfigNode* child_named(ConfigNode& table, std::string_view key) {
  const auto found = std::ranges::find(table.children, key, &ConfigNode::key);
  return found == table.children.end() ? nullptr : &*found;
}

/// The child with this key, made if it is not there.
ConfigNode& child_or_new(ConfigNode& table, const std::string& key, Kind kind) {
  if (ConfigNode* const found = child_named(table, key)) return *found;
  ConfigNode& made = table.children.emplace_back(table_node(key));
  made.kind = kind;
  return made;
}

template <class Value>
void set(ConfigNode& table, const std::string& key, Value value) {
  child_or_new(table, key, Kind::kScalar) = scalar_node(key, std::move(value));
}

void remove(ConfigNode& table, std::string_view key) {
  std::erase_if(table.children, [key](const ConfigNode& child) { return child.key == key; });
}

std::string text_of(const ConfigNode& table, std::string_view key) {
  const ConfigNode* const node = find_child(table, key);
  const auto* const text = node != nullptr ? std::get_if<std::string>(&node->scalar) : nullptr;
  return text != nullptr ? *text : std::string();
}

/// Tables key by key; every other value is replaced.
void merge(ConfigNode& into, const ConfigNode& from) {
  for (const ConfigNode& child : from.children) {
    ConfigNode* const there = child_named(into, child.key);
    if (there == nullptr) {
      into.children.push_back(child);
    } else if (there->kind == Kind::kTable && child.kind == Kind::kTable) {
      merge(*there, child);
    } else {
      *there = child;
    }
  }
}

/// Names of CSV files become absolute, because the composed file stands elsewhere.
void resolve_files(ConfigNode& node, const fs::path& folder) {
  auto* const text = node.kind == Kind::kScalar ? std::get_if<std::string>(&node.scalar) : nullptr;
  if (text != nullptr && text->ends_with(".csv")) *text = fs::absolute(folder / *text).lexically_normal();
  for (ConfigNode& child : node.children)
    resolve_files(child, folder);
}

/// Composes the bench of one case.
class Composer {
 public:
  Composer(const Case& c, fs::path bench_file) : case_(c), bench_file_(std::move(bench_file)) {}

  std::string text() {
    std::optional<ConfigNode> bench = read(bench_file_);
    problems_.throw_if_any();
    bench_ = std::move(*bench);
    resolve_files(bench_, bench_file_.parent_path());
    for (ConfigNode& axis : axes())
      locate_motor(axis);
    merge_overrides();
    for (ConfigNode& axis : axes())
      merge_motor(axis);
    remove_places(bench_);
    add_link();
    set_mode();
    if (case_.seed) set(bench_table(), "seed", *case_.seed);
    for (const Step& step : case_.steps)
      add(step);
    problems_.throw_if_any();
    return toml_text(bench_);
  }

  /// The messages of the case, each with the line at which it begins. The bench has the names of the axes.
  std::vector<ComposedMessage> messages() {
    std::optional<ConfigNode> bench = read(bench_file_);
    problems_.throw_if_any();
    bench_ = std::move(*bench);
    std::vector<ComposedMessage> all;
    for (const Step& step : case_.steps) {
      if (step.action != Step::Action::kMessage) continue;
      ConfigNode message = timed(step);
      if (const ConfigNode* const on = axis(step.axis, step.line, "step.axis"))
        set(message, "axis", text_of(*on, "name"));
      message.children.push_back(step.message);
      ConfigNode document = table_node("");
      child_or_new(document, "message", Kind::kArray).children.push_back(std::move(message));
      all.push_back({.line = step.line, .text = toml_text(document)});
    }
    problems_.throw_if_any();
    return all;
  }

  /// The bench as it is, with the link of the case.
  std::string linked_text() {
    std::optional<ConfigNode> bench = read(bench_file_);
    problems_.throw_if_any();
    bench_ = std::move(*bench);
    add_link();
    return toml_text(bench_);
  }

 private:
  std::optional<ConfigNode> read(const fs::path& file) {
    const FileText content = read_file(file, kMaxConfigBytes);
    if (content.why_not.empty()) return parse_document(content.text, file.string(), problems_);
    problems_.add(file.string(), 0, "", content.why_not);
    return std::nullopt;
  }

  void report(int line, std::string key, std::string rule) {
    problems_.add(case_.file, line > 0 ? line : case_.line, std::move(key), std::move(rule));
  }

  ConfigNode& bench_table() { return child_or_new(bench_, "bench", Kind::kTable); }
  std::vector<ConfigNode>& axes() { return child_or_new(bench_, "axis", Kind::kArray).children; }

  /// The axis with this name or number; a problem of `key` otherwise.
  ConfigNode* axis(const std::string& choice, int line, const std::string& key) {
    std::vector<ConfigNode>& all = axes();
    std::size_t number = 0;
    const auto [end, error] = std::from_chars(choice.data(), choice.data() + choice.size(), number);
    const bool is_number = error == std::errc{} && end == choice.data() + choice.size();
    if (is_number && number < all.size()) return &all[number];
    std::vector<std::string> names;
    for (ConfigNode& each : all) {
      names.push_back(text_of(each, "name"));
      if (names.back() == choice) return &each;
    }
    report(line, key,
           fmt::format("is \"{}\", no axis of the bench{}", printable(choice), advice(choice, names)));
    return nullptr;
  }

  /// The motor of the bench file is relative to it, one of the overrides to the case file.
  void locate_motor(ConfigNode& axis) {
    if (const std::string motor = text_of(axis, "motor"); !motor.empty()) {
      set(axis, "motor", fs::absolute(bench_file_.parent_path() / motor).lexically_normal().string());
    }
  }

  void merge_overrides() {
    for (const ConfigNode& child : case_.overrides.children) {
      if (child.key != "axis" || child.kind != Kind::kTable) {
        ConfigNode single = table_node("");
        single.children.push_back(child);
        merge(bench_, single);
        continue;
      }
      for (const ConfigNode& wanted : child.children) {
        ConfigNode* const there = axis(wanted.key, wanted.line, "override.axis");
        if (there == nullptr) continue;
        ConfigNode resolved = wanted;
        resolve_files(resolved, fs::path(case_.file).parent_path());
        if (const std::string motor = text_of(resolved, "motor"); !motor.empty()) {
          set(resolved, "motor", fs::absolute(fs::path(case_.file).parent_path() / motor).string());
        }
        merge(*there, resolved);
      }
    }
  }

  /// Puts the tables of the motor file into the axis, whose own values are the stronger ones.
  void merge_motor(ConfigNode& axis) {
    const std::string motor = text_of(axis, "motor");
    if (motor.empty()) return;
    if (const ConfigNode* const machine = find_child(axis, "machine");
        machine != nullptr && find_child(*machine, "kind") != nullptr) {
      report(machine->line, "override.axis.machine.kind",
             "cannot stand beside motor: the motor file has the kind");
    }
    std::optional<ConfigNode> file = read(motor);
    if (!file) return;
    resolve_files(*file, fs::path(motor).parent_path());
    const std::string name = text_of(*file, "name");
    remove(*file, "name");
    remove(*file, "source");
    // The mechanics of a shared shaft are those of the other axis.
    if (find_child(axis, "shares_shaft_with") != nullptr) remove(*file, "mechanics");
    for (ConfigNode& table : file->children) {
      ConfigNode& there = child_or_new(axis, table.key, Kind::kTable);
      merge(table, there);
      there = table;
    }
    remove(axis, "motor");
    set(axis, "motor_name", name);
  }

  /// A bus of its own for a program, at a port that the system chooses; for an attached drive the one at
  /// which it waits.
  void add_link() {
    using enum DeviceUnderTest::Link;
    const bool is_attached = case_.device.kind == DeviceUnderTest::Kind::kAttached;
    if (case_.device.link == kTcp && is_attached) {
      ConfigNode& tcp = child_or_new(bench_, "tcp", Kind::kTable);
      merge(tcp, case_.device.place);
      if (const std::string tokens = text_of(tcp, "tokens_file"); !tokens.empty())
        set(tcp, "tokens_file",
            fs::absolute(fs::path(case_.file).parent_path() / tokens).lexically_normal().string());
    } else if (case_.device.link == kModbus) {
      ConfigNode& modbus = child_or_new(bench_, "modbus", Kind::kTable);
      if (!is_attached) set(modbus, "port", std::int64_t{0});
      set(modbus, "allow_writes", true);
      merge(modbus, case_.device.place);
    } else if (case_.device.link == kCan) {
      add_bus(is_attached);
    }
  }

  /// Nodes of CAN count like units of Modbus: from 1, in the order of the axes. Those that an attached drive
  /// knows are in its bench file.
  void add_bus(bool is_attached) {
    ConfigNode bus = table_node("");
    if (is_attached) {
      merge(bus, case_.device.place);
    } else {
      set(bus, "backend", std::string("slcan"));
      set(bus, "channel", std::string("tcp:127.0.0.1:0"));
    }
    child_or_new(bench_, "can", Kind::kArray).children.push_back(std::move(bus));
    for (std::size_t i = 0; !is_attached && i < axes().size(); ++i)
      set(axes()[i], "can_node", static_cast<std::int64_t>(i) + 1);
  }

  /// In lockstep the delay and the arming of the bench's own mode stay.
  void set_mode() {
    ConfigNode& bench = bench_table();
    const bool was_realtime = text_of(bench, "mode") == "realtime";
    set(bench, "mode", std::string(case_.is_realtime ? "realtime" : "lockstep"));
    if (!was_realtime && !case_.is_realtime) remove(bench_, "realtime");
    if (!was_realtime || case_.is_realtime) return;
    if (find_child(bench, "command_delay_ticks") == nullptr)
      set(bench, "command_delay_ticks", std::int64_t{1});
    if (find_child(bench, "arming_commands") == nullptr) set(bench, "arming_commands", std::int64_t{10});
    remove(bench_, "realtime");
  }

  /// A step is an event of its axis in the bench file.
  void add(const Step& step) {
    ConfigNode* const on = axis(step.axis, step.line, "step.axis");
    if (on == nullptr) return;
    if (step.action == Step::Action::kMessage) return;
    ConfigNode event = timed(step);
    add_action(event, step);
    child_or_new(*on, std::string(event_table(step.action)), Kind::kArray)
        .children.push_back(std::move(event));
  }

  /// A table with the time of a step.
  ConfigNode timed(const Step& step) {
    ConfigNode event = table_node("");
    if (step.at_s && case_.device.kind == DeviceUnderTest::Kind::kAttached) {
      add_time_since_arming(event, *step.at_s);
    } else if (step.at_s) {
      set(event, "at_s", *step.at_s);
    }
    if (step.when) set(event, "when", step.when->text);
    if (step.for_s > 0.0) set(event, "for_s", step.for_s);
    if (step.delay_s > 0.0) set(event, "delay_s", step.delay_s);
    return event;
  }

  /// A case with an attached drive begins when the drive arms.
  void add_time_since_arming(ConfigNode& event, double at_s) {
    const ConfigNode* const device = axis(case_.device.axis, case_.device.line, "dut.axis");
    if (device == nullptr) return;
    set(event, "when", fmt::format("{}.state == 1", text_of(*device, "name")));
    if (at_s > 0.0) set(event, "delay_s", at_s);
  }

  static void add_action(ConfigNode& event, const Step& step) {
    if (step.action == Step::Action::kMultisine) return merge(event, step.multisine);
    const std::string key = step.action == Step::Action::kLoad      ? "load_nm"
                            : step.action == Step::Action::kImpulse ? "impulse_nms"
                                                                    : "value";
    if (step.action == Step::Action::kFault) set(event, "name", step.name);
    if (step.action == Step::Action::kParameter) set(event, "parameter", step.name);
    set(event, key, step.value.scalar);
    if (step.ramp_s > 0.0) set(event, "ramp_s", step.ramp_s);
  }

  const Case& case_;
  fs::path bench_file_;
  ConfigNode bench_{};
  ProblemList problems_;
};

}  // namespace

std::string_view event_table(Step::Action action) noexcept {
  switch (action) {
    case Step::Action::kParameter:
      return "set";
    case Step::Action::kFault:
      return "fault";
    case Step::Action::kImpulse:
      return "bump";
    case Step::Action::kMultisine:
      return "multisine";
    case Step::Action::kMessage:  // no event
    case Step::Action::kLoad:
      break;
  }
  return "load";
}

std::string composed_bench(const Case& c, const fs::path& bench_file) {
  return Composer(c, bench_file).text();
}

std::string linked_bench(const Case& c, const fs::path& composed) {
  return Composer(c, composed).linked_text();
}

std::vector<ComposedMessage> composed_messages(const Case& c, const fs::path& composed) {
  return Composer(c, composed).messages();
}

void remove_places(ConfigNode& bench) {
  for (const std::string_view table : kTablesOfAPlace)
    remove(bench, table);
}

}  // namespace drivebench::regression
