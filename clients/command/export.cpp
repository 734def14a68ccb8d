#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <span>
#include <string_view>
#include <system_error>

#include "clients/command/commands.hpp"
#include "clients/command/json.hpp"
#include "clients/command/session.hpp"
#include "protocols/catalogue.hpp"
#include "protocols/mapped_file.hpp"
#include "protocols/mcap.hpp"
#include "protocols/sample_codec.hpp"

namespace drivebench::command {
namespace {

std::string system_reason() {
  return std::generic_category().message(errno);
}

MappedFile opened(const std::string& path) {
  try {
    return MappedFile(path);
  } catch (const std::system_error& error) {
    throw UsageError(error.what());
  }
}

/// Standard output or a file.
class Output {
 public:
  explicit Output(const std::string& path)
      : path_(path.empty() ? "standard output" : path),
        file_(path.empty() ? stdout : std::fopen(path.c_str(), "wbe"),
              path.empty() ? &keep_open : &std::fclose) {
    if (!file_) throw UsageError(fmt::format("cannot write {}: {}", path_, system_reason()));
  }

  void write(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) fail();
  }
  void finish() {
    if (std::fflush(file_.get()) != 0) fail();
  }

 private:
  static int keep_open(std::FILE*) { return 0; }
  [[noreturn]] void fail() {
    throw std::runtime_error(fmt::format("cannot write {}: {}", path_, system_reason()));
  }

  std::string path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

/// The axis whose samples are on this topic, `/<axis>/sample`; empty for other topics.
std::string_view axis_of(std::string_view topic) {
  constexpr std::string_view kEnd = "/sample";
  if (!topic.starts_with('/') || !topic.ends_with(kEnd) || topic.size() <= kEnd.size() + 1) return {};
  return topic.substr(1, topic.size() - 1 - kEnd.size());
}

std::vector<const Signal*> chosen_signals(const std::vector<std::string>& names) {
  std::vector<const Signal*> signals;
  for (const std::string& name : names) {
    const Signal* signal = find_signal(name);
    if (signal == nullptr) throw UsageError(fmt::format("no signal '{}'", name));
    signals.push_back(signal);
  }
  if (names.empty()) {
    for (const Signal& signal : kSignals) {
      if (signal.name != "tick") signals.push_back(&signal);  // it stands in front of every row
    }
  }
  return signals;
}

std::string header_of(const std::vector<const Signal*>& signals) {
  std::string header = "tick,time_s";
  for (const Signal* signal : signals)
    header += fmt::format(",{} [{}]", signal->name, signal->unit);
  return header + "\n";
}

void append_row(std::string& text, const Sample& sample, std::uint64_t time_ns,
                const std::vector<const Signal*>& signals) {
  auto out = std::back_inserter(text);
  fmt::format_to(out, "{},{}.{:09}", sample.tick, time_ns / 1'000'000'000, time_ns % 1'000'000'000);
  for (const Signal* signal : signals) {
    switch (signal->type) {
      case SignalType::kUnsigned:
        fmt::format_to(out, ",{}", sample.*signal->as_unsigned);
        break;
      case SignalType::kSigned:
        fmt::format_to(out, ",{}", sample.*signal->as_signed);
        break;
      case SignalType::kReal:
        fmt::format_to(out, ",{}", sample.*signal->as_real);  // the shortest text that reads back equal
        break;
    }
  }
  text += '\n';
}

struct Exported {
  std::string axis;
  std::uint64_t rows = 0;
  std::string other_axes;
};

/// Refuses what would cost the output file what it held, or the recording itself.
void check_files(const McapReader& reader, const ExportOptions& options) {
  if (reader.problem() && reader.problem()->kind == McapProblem::Kind::kNotMcap) {
    throw UsageError(fmt::format("{} is not a recording: {}", options.recording, reader.problem()->what));
  }
  std::error_code ignored;
  if (std::filesystem::equivalent(options.recording, options.out_file, ignored)) {
    throw UsageError(fmt::format("--out {} is the recording itself", options.out_file));
  }
}

/// Everything that can be read, row by row. Without a name the axis is the first that comes.
Exported export_rows(McapReader& reader, const ExportOptions& options,
                     const std::vector<const Signal*>& signals, std::size_t file_size, Output& out) {
  constexpr std::size_t kPiece = 1U << 16;
  Exported done;
  done.axis = options.axis;
  Progress progress("export");
  std::string text;
  bool has_header = false;
  std::map<std::uint16_t, bool> wanted;  // by channel
  std::uint64_t seen_bytes = 0;
  for (McapMessage message; reader.next(message);) {
    seen_bytes += message.payload.size() + 31;  // a message record's own bytes, for the progress only
    auto known = wanted.find(message.header.channel);
    if (known == wanted.end()) {
      const std::string_view axis = axis_of(reader.channels().at(message.header.channel).topic);
      if (!axis.empty() && done.axis.empty()) done.axis = axis;
      known = wanted.emplace(message.header.channel, !axis.empty() && axis == done.axis).first;
      if (!axis.empty() && axis != done.axis) {
        done.other_axes += fmt::format("{}{}", done.other_axes.empty() ? "" : ", ", axis);
      }
    }
    if (!known->second) continue;
    if (!has_header) text += header_of(signals);  // not before it is certain that there is something to head
    has_header = true;
    const std::optional<Sample> sample = decode_sample(message.payload);
    if (!sample || sample->tick < options.from_tick || sample->tick > options.to_tick) continue;
    append_row(text, *sample, message.header.log_time_ns, signals);
    ++done.rows;
    if (text.size() > kPiece) {
      out.write(text);
      text.clear();
      progress.update(static_cast<double>(seen_bytes) / static_cast<double>(file_size), options.recording);
    }
  }
  out.write(text);
  out.finish();
  return done;
}

}  // namespace

int run_export(const ExportOptions& options) {
  const MappedFile file = opened(options.recording);
  McapReader reader(file.bytes());
  const std::vector<const Signal*> signals = chosen_signals(options.signals);
  check_files(reader, options);
  Output out(options.out_file);
  const Exported done = export_rows(reader, options, signals, file.bytes().size(), out);

  const std::string problem = reader.problem() ? reader.problem()->what : "";
  std::FILE* const told = options.out_file.empty() ? stderr : stdout;  // standard output may be the CSV
  if (options.json) {
    fmt::print(told, "{}\n", export_json(options.out_file, done.axis, done.rows, problem));
  } else {
    fmt::print(told, "export: {} samples of axis {}{}{}\n", done.rows, done.axis.empty() ? "?" : done.axis,
               options.out_file.empty() ? "" : " to ", options.out_file);
  }
  if (!problem.empty()) {
    fmt::print(stderr, "drivebench: the recording is not whole: {}\n", problem);
    return kExitCutShort;
  }
  if (done.rows == 0 && !done.other_axes.empty()) {
    throw UsageError(
        fmt::format("no samples of axis '{}'; the recording has {}", done.axis, done.other_axes));
  }
  if (!done.other_axes.empty() && options.axis.empty()) {
    fmt::print(stderr, "export: the recording also has {}; --axis chooses\n", done.other_axes);
  }
  return kExitOk;
}

}  // namespace drivebench::command
