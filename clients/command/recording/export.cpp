#include "clients/command/recording/export.hpp"

#include <bench.pb.h>
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/basics/signals.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/recording/export_can.hpp"
#include "clients/command/recording/recording_file.hpp"
#include "clients/command/recording/tables/sample_table.hpp"
#include "clients/command/recording/wall_time.hpp"
#include "protocols/json.hpp"
#include "protocols/mcap/time_base.hpp"
#include "protocols/sample_codec.hpp"
#include "protocols/signals/catalogue.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

/// Bytes between two writes of text and two updates of the progress.
constexpr std::size_t kPiece = 1U << 16U;

/// The format that the name of the output promises: csv where it promises none.
std::string format_of(const std::string& out_file) {
  const std::string suffix = std::filesystem::path(out_file).extension().string();
  return suffix == ".mat" || suffix == ".h5" ? "mat" : suffix == ".mf4" ? "mdf" : "csv";
}

/// The named signals; without names all but the tick, which begins every row.
std::vector<const Signal*> chosen_signals(const std::vector<std::string>& names) {
  std::vector<const Signal*> signals = signals_named(names);
  if (!names.empty()) return signals;
  for (const Signal& signal : kSignals) {
    if (signal.name != "tick") signals.push_back(&signal);
  }
  return signals;
}

struct Exported {
  std::string axis;
  std::uint64_t rows = 0;  ///< or frames
  std::string other_axes;
  std::string problem;  ///< of the recording; empty: none
};

/// Finds the messages of an axis by their channel.
class AxisChannels {
 public:
  /// Without a name it takes the first axis in the file.
  explicit AxisChannels(std::string axis) : axis_(std::move(axis)) {}

  struct Place {
    bool is_sample;
    bool is_wanted;
    std::uint32_t number;  ///< of the axis: a tick has the samples of all axes in their order
  };
  const Place& find(const McapReader& reader, std::uint16_t channel) {
    const auto known = places_.find(channel);
    if (known != places_.end()) return known->second;
    const std::string_view name = axis_of(reader.channels().at(channel).topic);
    if (!name.empty() && axis_.empty()) axis_ = name;
    const bool is_wanted = !name.empty() && name == axis_;
    if (!name.empty() && !is_wanted) others_ += fmt::format("{}{}", others_.empty() ? "" : ", ", name);
    return places_[channel] = {!name.empty(), is_wanted, name.empty() ? 0 : count_++};
  }
  const std::string& axis() const noexcept { return axis_; }
  const std::string& others() const noexcept { return others_; }

 private:
  std::string axis_;
  std::string others_;
  std::uint32_t count_ = 0;
  std::map<std::uint16_t, Place> places_;
};

/// Refuses an axis without samples.
void check_axis(const MappedSeries& files, const std::string& axis) {
  if (axis.empty()) return;
  McapSeries reader(files.segments());
  AxisChannels channels(axis);
  for (McapMessage message; reader.next(message);) {
    if (channels.find(reader.reader(), message.header.channel).is_wanted)
      return;  // usually in the first tick
  }
  throw UsageError(fmt::format("no samples of axis '{}'; the recording has {}{}", axis,
                               channels.others().empty() ? "none" : channels.others(),
                               reader.problem() ? ", and is not whole: " + reader.problem()->what : ""));
}

/// Refuses an export that would overwrite the recording, or replace the output file without data.
void check_files(const McapSeries& reader, const MappedSeries& files, const ExportOptions& options) {
  refuse_other_files(reader, options.recording);
  check_axis(files, options.axis);
  std::error_code ignored;
  if (std::filesystem::equivalent(options.recording, options.out_file, ignored)) {
    throw UsageError(fmt::format("--out {} is the recording itself", options.out_file));
  }
}

/// The end of a recording, as its last message tells it.
struct End {
  std::optional<v1::Verdict> verdict{};

  void look_at(const McapReader& reader, const McapMessage& message) {
    if (reader.channels().at(message.header.channel).topic != "/verdict") return;
    verdict.emplace().ParseFromArray(message.payload.data(), static_cast<int>(message.payload.size()));
  }
};

/// The reason for which the recording is not the whole run; empty: it is.
std::string problem_of(const McapSeries& reader, const End& end) {
  if (reader.problem()) return reader.problem()->what;
  if (!end.verdict) return "it has no end: it holds no verdict";
  if (end.verdict->gaps() > 0) return fmt::format("it lost {} entries while recording", end.verdict->gaps());
  return {};
}

/// Gives every readable message to `take`.
template <class Take>
End for_each_message(McapSeries& reader, const ExportOptions& options, std::uint64_t file_size, Take take) {
  Progress progress("export");
  std::uint64_t seen_bytes = 0;
  std::uint64_t shown_bytes = 0;
  End end;
  for (McapMessage message; reader.next(message);) {
    seen_bytes += message.payload.size() + 31;  // a message record's own bytes, for the progress only
    end.look_at(reader.reader(), message);
    take(message);
    if (seen_bytes - shown_bytes < kPiece) continue;
    shown_bytes = seen_bytes;
    progress.update(static_cast<double>(seen_bytes) / static_cast<double>(file_size), options.recording);
  }
  return end;
}

/// Exports every readable sample, row by row.
Exported export_rows(McapSeries& reader, const ExportOptions& options, std::uint64_t file_size,
                     const Epoch& epoch, SampleTable& table) {
  Exported done;
  AxisChannels channels(options.axis);
  WallTime wall(epoch);
  const End end = for_each_message(reader, options, file_size, [&](const McapMessage& message) {
    if (!channels.find(reader.reader(), message.header.channel).is_wanted) return;
    const std::optional<Sample> sample = decode_sample(message.payload);
    if (!sample || sample->tick < options.from_tick || sample->tick > options.to_tick) return;
    const std::uint64_t time_ns = message.header.log_time_ns;
    table.add(*sample, {.bench_ns = time_ns, .unix_ns = wall.unix_ns_of(reader.reader(), time_ns)});
    ++done.rows;
  });
  done.axis = channels.axis();
  table.finish(done.axis);
  done.problem = problem_of(reader, end);
  done.other_axes = channels.others();
  return done;
}

/// Whether the recording ends with the verdict of a lockstep run.
bool is_lockstep(const MappedSeries& files) {
  McapSeries reader(files.segments());
  End end;
  for (McapMessage message; reader.next(message);)
    end.look_at(reader.reader(), message);
  return end.verdict && end.verdict->mode() == v1::MODE_LOCKSTEP;
}

/// The interface, profile and nodes of the frames.
link::CanAddress can_address_of(const ExportOptions& options) {
  return link::parse_can_address(fmt::format("can:socketcan:{}?node={}{}{}{}", options.interface,
                                             options.node_base, options.classic ? "&fd=0" : "",
                                             options.profile.empty() ? "" : "&", options.profile));
}

/// Exports the frames of all axes, or of the named one. In real time they have the wall's time, as those of
/// candump have.
Exported export_frames(McapSeries& reader, const ExportOptions& options, const MappedSeries& files,
                       const Epoch& epoch) {
  check_suffix(options.out_file, {".log", ".txt"});
  Output out(options.out_file);
  Exported done;
  CandumpText frames(can_address_of(options), is_lockstep(files));
  AxisChannels channels(options.axis);
  WallTime wall(epoch);
  std::optional<std::uint32_t> only;  // the named axis, from its first sample on
  const auto take = [&](const McapMessage& message) {
    const auto& place = channels.find(reader.reader(), message.header.channel);
    const auto time_ns = static_cast<double>(wall.unix_ns_of(reader.reader(), message.header.log_time_ns));
    const double time_s = time_ns * 1e-9;
    if (place.is_sample) {
      if (!options.axis.empty() && !place.is_wanted) return;
      only = place.number;
      const std::optional<Sample> sample = decode_sample(message.payload);
      if (!sample || sample->tick < options.from_tick || sample->tick > options.to_tick) return;
      frames.add(place.number, *sample, time_s);
    } else if (reader.reader().channels().at(message.header.channel).topic == "/inputs") {
      v1::Input input;
      if (!input.ParseFromArray(message.payload.data(), static_cast<int>(message.payload.size()))) return;
      const std::uint64_t tick = input.received_tick();
      if (tick < options.from_tick || tick > options.to_tick) return;
      if (!options.axis.empty() && input.axis() != only) return;
      frames.add(input, time_s);
    }
  };
  const End end = for_each_message(reader, options, files.size(), [&](const McapMessage& message) {
    take(message);
    if (frames.text().size() <= kPiece) return;
    out.write(frames.text());
    frames.text().clear();
  });
  frames.finish();
  out.write(frames.text());
  out.flush();
  done.problem = problem_of(reader, end);
  done.rows = frames.frames();
  done.axis = options.axis;
  done.other_axes = channels.others();
  return done;
}

/// Without those that are named twice, and without the tick, which every table has.
Signals each_once(const Signals& signals) {
  Signals once;
  for (const Signal* signal : signals) {
    if (signal->name != "tick" && std::ranges::find(once, signal) == once.end()) once.push_back(signal);
  }
  return once;
}

Exported export_table(McapSeries& reader, const ExportOptions& options, const Signals& signals,
                      std::uint64_t file_size, const Epoch& epoch) {
  if (options.format == "csv") {
    check_suffix(options.out_file, {".csv", ".txt"});
    Output out(options.out_file);
    return export_rows(reader, options, file_size, epoch, *csv_table(out, signals, epoch));
  }
  const Signals columns = each_once(signals);
  if (options.out_file.empty()) throw UsageError("--format " + options.format + " needs --out FILE");
  if (options.format == "mat") {
    check_suffix(options.out_file, {".mat", ".h5"});
    return export_rows(reader, options, file_size, epoch, *mat_table(options.out_file, columns, epoch));
  }
  check_suffix(options.out_file, {".mf4"});
  return export_rows(reader, options, file_size, epoch, *mdf_table(options.out_file, columns, epoch));
}

}  // namespace

int run_export(const ExportOptions& line) {
  ExportOptions options = line;
  if (options.format.empty()) options.format = format_of(options.out_file);
  const bool is_table = options.format != "candump";
  const MappedSeries files = open_recording(options.recording);
  McapSeries reader(files.segments());
  const Signals signals = chosen_signals(options.signals);
  if (!is_table) can_address_of(options);  // refuses wrong options before it creates the file
  if (!is_table && !options.signals.empty()) throw UsageError("--signals chooses columns of a table");
  if (options.from_tick > options.to_tick) {
    throw UsageError(fmt::format("--from {} is behind --to {}", options.from_tick, options.to_tick));
  }
  check_files(reader, files, options);
  const Epoch epoch = epoch_of(files);
  const Exported done = is_table ? export_table(reader, options, signals, files.size(), epoch)
                                 : export_frames(reader, options, files, epoch);

  std::FILE* const told = options.out_file.empty() ? stderr : stdout;  // standard output may be the data
  if (options.json) {
    Json json{{"out", options.out_file},
              {"axis", is_table || !done.axis.empty() ? done.axis : "*"},
              {"rows", done.rows},
              {"problem", done.problem}};
    if (epoch) json["epoch_unix_ns"] = *epoch;
    fmt::print(told, "{}\n", json_text(json));
  } else {
    const std::string of = done.axis.empty() ? "all axes" : "axis " + printable(done.axis);
    fmt::print(told, "export: {} {} of {}{}{}{}\n", done.rows, is_table ? "samples" : "frames", of,
               options.out_file.empty() ? "" : " to ", options.out_file,
               epoch ? "; in real time, tick 0 began at " + utc_text(*epoch) : "");
  }
  if (!done.problem.empty()) {
    fmt::print(stderr, "drivebench: the recording is not whole: {}\n", done.problem);
    return kExitCutShort;
  }
  if (is_table && !done.other_axes.empty() && options.axis.empty()) {
    fmt::print(stderr, "export: the recording also has {}; --axis chooses\n", done.other_axes);
  }
  return kExitOk;
}

}  // namespace drivebench::command
