#include "clients/command/identify/data/identify_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/identify/data/identify_map.hpp"
#include "clients/command/identify/data/identify_options.hpp"
#include "clients/command/recording/recorded_configuration.hpp"
#include "clients/command/recording/recording_file.hpp"
#include "protocols/document.hpp"
#include "protocols/sample_codec.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {
namespace {

using identification::BenchParameters;
using identification::MeasuredData;

/// The name of the configuration in a recording.
constexpr std::string_view kConfiguration = "bench.toml";

/// The samples of one axis as columns, tick by tick.
class AxisColumns {
 public:
  explicit AxisColumns(std::string axis) : axis_(std::move(axis)) {
    for (const std::string_view name :
         {"u_a_v", "u_b_v", "u_c_v", "i_a_a", "i_b_a", "i_c_a", "encoder_count", "angle_rad", "load_nm"}) {
      signals_.push_back(find_signal(name));
      data_.columns.push_back({std::string(name), std::string(signals_.back()->unit), {}});
    }
  }

  void take(const McapReader& file, const McapMessage& message) {
    const std::string_view axis = axis_of(file.channels().at(message.header.channel).topic);
    if (axis.empty()) return;
    if (std::ranges::find(axes_, axis) == axes_.end()) axes_.emplace_back(axis);
    if (axis_.empty()) axis_ = axis;
    if (axis_ != axis) return;
    if (const std::optional<Sample> sample = decode_sample(message.payload)) {
      add(*sample, message.header.log_time_ns);
    }
  }

  const std::string& axis() const noexcept { return axis_; }
  std::string axes() const { return fmt::format("{}", fmt::join(axes_, ", ")); }
  /// Empty if the samples are a record without holes.
  const std::string& hole() const noexcept { return hole_; }
  MeasuredData take_data() {
    const std::size_t count = data_.samples();
    if (count > 1)
      data_.period_s = 1e-9 * static_cast<double>(last_ns_ - first_ns_) / static_cast<double>(count - 1);
    return std::move(data_);
  }

 private:
  void add(const Sample& sample, std::uint64_t time_ns) {
    const bool is_first = data_.samples() == 0;
    if (!is_first && sample.tick != last_tick_ + 1 && hole_.empty())
      hole_ = fmt::format("tick {} comes after tick {}", sample.tick, last_tick_);
    if (is_first) first_ns_ = time_ns;
    last_ns_ = time_ns;
    last_tick_ = sample.tick;
    for (std::size_t k = 0; k < signals_.size(); ++k)
      data_.columns[k].values.push_back(value_of(*signals_[k], sample));
  }

  std::string axis_;
  std::vector<std::string> axes_;
  std::vector<const Signal*> signals_;
  MeasuredData data_;
  std::string hole_;
  std::uint64_t last_tick_ = 0;
  std::uint64_t first_ns_ = 0;
  std::uint64_t last_ns_ = 0;
};

void take_scalars(const ConfigNode& section, BenchParameters& parameters) {
  for (const ConfigNode& node : section.children) {
    const std::string name = section.key + "." + node.key;
    if (node.kind != ConfigNode::Kind::kScalar) continue;
    if (const auto* real = std::get_if<double>(&node.scalar)) parameters[name] = *real;
    if (const auto* whole = std::get_if<std::int64_t>(&node.scalar))
      parameters[name] = static_cast<double>(*whole);
    if (const auto* flag = std::get_if<bool>(&node.scalar)) parameters[name] = *flag ? 1.0 : 0.0;
  }
}

/// Whether a machine of a configuration has a third phase.
bool has_three_phases(const std::string& machine, const BenchParameters& parameters) {
  const auto star = parameters.find("machine.star");
  return machine == "bldc" || (star != parameters.end() && star->second != 0.0);
}

void read_configuration(const McapReader& file, const std::string& axis, MeasuredMotor& m) {
  for (const McapAttachment& attachment : file.attachments()) {
    if (attachment.name != kConfiguration) continue;
    const std::string_view text(reinterpret_cast<const char*>(attachment.data.data()),
                                attachment.data.size());
    take_configuration(text, axis, m);
  }
  if (m.bench.empty()) return;
  take_facts(m.bench, m.drive, m.substeps, m.facts);
  m.facts.three_phase = has_three_phases(m.machine, m.bench);
}

/// The word that a setting chooses.
std::string setting_word(const v1::AxisDescription& axis, const v1::NamedValue& setting) {
  for (const v1::ParameterDescription& parameter : axis.parameters()) {
    if (parameter.name() != setting.name()) continue;
    const double place = setting.value();
    if (place >= 0.0 && place < parameter.words_size()) return parameter.words(static_cast<int>(place));
  }
  return {};
}

}  // namespace

void take_description(const v1::BenchDescription& bench, std::uint32_t number,
                      const v1::RunExperiment& request, MeasuredMotor& m) {
  const v1::AxisDescription& axis = bench.axes(static_cast<int>(number));
  m.machine = axis.machine_kind();
  m.motor = axis.machine();
  m.drive = axis.drive_kind();
  m.substeps = static_cast<int>(bench.substeps());
  m.bench.clear();
  for (const v1::ParameterDescription& parameter : axis.parameters())
    m.bench[parameter.name()] = parameter.value();
  for (const v1::NamedValue& setting : request.settings()) {
    m.bench[setting.name()] = setting.value();
    if (setting.name() == "drive.kind") m.drive = setting_word(axis, setting);
  }
  for (const v1::ExperimentEvent& event : request.events()) {
    if (event.has_parameter()) m.bench.erase(event.parameter().name());
  }
  take_facts(m.bench, m.drive, m.substeps, m.facts);
  m.facts.three_phase = axis.phases() == 3;
  m.facts.decimation = std::max(1, static_cast<int>(request.decimation()));
}

void take_configuration(std::string_view toml, const std::string& axis, MeasuredMotor& m) {
  ProblemList problems;
  const auto document = parse_document(toml, "bench.toml", problems, kMaxRecordedConfigBytes);
  const ConfigNode* const axes = document ? child_of(*document, "axis") : nullptr;
  if (axes == nullptr || axes->kind != ConfigNode::Kind::kArray) return;
  const auto found = std::ranges::find_if(
      axes->children, [&](const ConfigNode& node) { return axis.empty() || text_of(node, "name") == axis; });
  if (found == axes->children.end()) return;
  BenchParameters all;
  if (const ConfigNode* const bench = child_of(*document, "bench")) take_scalars(*bench, all);
  if (all.contains("bench.substeps"))
    m.substeps = static_cast<int>(std::clamp(all["bench.substeps"], 1.0, 1e6));
  m.motor = text_of(*found, "motor_name");
  m.drive = "voltage_amplifier";
  m.bench.clear();
  for (const ConfigNode& section : found->children) {
    if (section.kind != ConfigNode::Kind::kTable) continue;
    take_scalars(section, m.bench);
    if (section.key == "machine") m.machine = text_of(section, "kind");
    if (section.key == "drive" && child_of(section, "kind") != nullptr) m.drive = text_of(section, "kind");
  }
  // A value that changes during the run is unknown.
  if (const ConfigNode* const changes = child_of(*found, "set")) {
    for (const ConfigNode& change : changes->children)
      m.bench.erase(text_of(change, "parameter"));
  }
}

MeasuredMotor read_recording(const std::string& path, const std::string& axis) {
  MeasuredMotor m;
  const MappedSeries files = open_recording(path);
  McapSeries reader(files.segments());
  refuse_other_files(reader, path);
  AxisColumns columns(axis);
  for (McapMessage message; reader.next(message);)
    columns.take(reader.reader(), message);
  if (!columns.hole().empty())
    throw UsageError(
        fmt::format("{}: axis {}: {}; every tick is needed", path, columns.axis(), columns.hole()));
  m.data = columns.take_data();
  if (m.data.samples() < 2)
    throw UsageError(fmt::format("{}: no samples of axis '{}'; the recording has {}{}", path, columns.axis(),
                                 columns.axes(), reader.problem() ? "; " + reader.problem()->what : ""));
  if (reader.problem())
    fmt::print(stderr, "identify: the recording is not whole: {}; its sound part is used\n",
               reader.problem()->what);
  read_configuration(reader.reader(), columns.axis(), m);
  m.source = fmt::format("recording {}, axis {}", path, columns.axis());
  return m;
}

MeasuredMotor read_foreign(const IdentifyOptions& options) {
  MeasuredMotor m;
  try {
    m.data = identification::read_csv(options.from_file, csv_options(options));
  } catch (const identification::IdentificationError& error) {
    throw UsageError(error.what());
  }
  // A column of zeros is a terminal that the machine does not have.
  const auto lives = [&m](const char* name) {
    const identification::Column* const column = m.data.find(name);
    return column != nullptr && std::ranges::any_of(column->values, [](double x) { return x != 0.0; });
  };
  m.facts.three_phase = lives("i_c_a") || lives("u_c_v");
  m.source = "file " + options.from_file;
  return m;
}

MeasuredMotor read_measurement(const IdentifyOptions& options, const identification::MotorName& motor) {
  MeasuredMotor m = options.from_file.ends_with(".mcap") ? read_recording(options.from_file, options.axis)
                                                         : read_foreign(options);
  if (!m.machine.empty() && !identification::is_machine_of(m.machine, motor.machine))
    throw UsageError(fmt::format("{} is of kind {}, --motor {} is for {}", m.source, m.machine, motor.name,
                                 motor.machine));
  return m;
}

std::string csv_of(const MeasuredData& data) {
  std::string text = "time_s";
  auto out = std::back_inserter(text);
  for (const identification::Column& column : data.columns) {
    fmt::format_to(out, ",{}", column.name);
    if (!column.unit.empty()) fmt::format_to(out, " [{}]", column.unit);
  }
  text += '\n';
  for (std::size_t k = 0; k < data.samples(); ++k) {
    fmt::format_to(out, "{:.9f}", data.period_s * static_cast<double>(k));
    for (const identification::Column& column : data.columns)
      fmt::format_to(out, ",{}", column.values[k]);
    text += '\n';
  }
  return text;
}

}  // namespace drivebench::command
