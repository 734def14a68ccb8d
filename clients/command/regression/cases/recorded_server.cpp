#include "clients/command/regression/cases/recorded_server.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/regression/suite/compose.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using regression::RunFacts;

constexpr auto kServerStart = 20s;
constexpr auto kServerEnd = 20s;
constexpr std::size_t kMostOutput = 65'536;
constexpr const char* kSocket = "bench.sock";
constexpr const char* kMessages = "messages.toml";

}  // namespace

RecordedServer::RecordedServer(const PreparedCase& prepared, const fs::path& folder, const RunWishes& wishes)
    : socket_(fs::absolute(folder / kSocket)),
      recording_(fs::absolute(recording_in(folder))),
      log_(fs::absolute(folder / "server.log")),
      process_(line_of(prepared, wishes),
               {.folder = fs::absolute(folder).string(), .error_file = log_.string()}) {
  // A server that repeats a run is ready only after that.
  const std::chrono::milliseconds patience =
      wishes.repeats ? kRepetitionPatience : std::chrono::milliseconds(kServerStart);
  const auto ready = await_answer(process_, patience, parse_ready);
  if (!ready) throw std::runtime_error("the server did not start: " + tail_of(log_));
  ready_ = *ready;
}

std::string RecordedServer::link(regression::DeviceUnderTest::Link way, std::size_t axis) const {
  switch (way) {
    using enum regression::DeviceUnderTest::Link;
    case kTcp:
      return "tcp:" + ready_.tcp;
    case kSharedMemory:
      return "shm:" + socket_.string();
    case kCan:
      return fmt::format("can:{}?fd=1&node={}", ready_.can.at(0), axis + 1);
    case kModbus:
      return fmt::format("modbus:{}?unit={}", ready_.modbus, axis + 1);
    case kUnix:
      break;
  }
  return "unix:" + socket_.string();
}

ServerReport RecordedServer::end() {
  process_.terminate();
  auto report = process_.await(Process::in(kServerEnd), parse_report);
  if (!process_.wait(Process::in(kServerEnd))) throw std::runtime_error("the server did not end");
  return std::move(report).value_or(ServerReport());
}

void RecordedServer::add_messages(const PreparedCase& prepared, std::vector<std::string>& line) {
  std::string text;
  for (const auto& message : regression::composed_messages(*prepared.what, prepared.bench_file))
    text += message.text;
  if (text.empty()) return;
  write_file(socket_.parent_path() / kMessages, text);
  line.insert(line.end(), {"--messages", kMessages});
  const auto is_line = [](const regression::Step& step) { return step.message.key == "line"; };
  if (std::ranges::none_of(prepared.what->steps, is_line)) return;
  lines_ = socket_.parent_path() / "lines";
  if (::mkfifo(lines_.c_str(), 0600) != 0) throw std::system_error(errno, std::generic_category(), lines_);
  line.insert(line.end(), {"--lines", lines_});
}

std::vector<std::string> RecordedServer::line_of(const PreparedCase& prepared, const RunWishes& wishes) {
  std::vector<std::string> line{server_executable().string(),
                                fs::absolute(prepared.bench_file).string(),
                                "--json",
                                "--unix",
                                kSocket,
                                "--record",
                                recording_.string()};
  using regression::DeviceUnderTest;
  const DeviceUnderTest& device = prepared.what->device;
  const bool has_port =
      device.kind == DeviceUnderTest::Kind::kAttached && device.link == DeviceUnderTest::Link::kTcp;
  if (!has_port) line.insert(line.end(), {"--port", "0"});
  const bool ends_in_lockstep = !prepared.what->is_realtime && prepared.facts.end_tick != RunFacts{}.end_tick;
  if (ends_in_lockstep) {
    line.emplace_back("--duration");
    line.push_back(fmt::to_string(static_cast<double>(prepared.facts.end_tick) * prepared.facts.period_s));
  }
  if (wishes.timing) line.emplace_back("--measure-answers");
  add_messages(prepared, line);
  if (wishes.repeats) {
    line.insert(line.end(), {"--repeat", fs::absolute(wishes.repeats->recording).string(), "--until",
                             fmt::to_string(wishes.repeats->until)});
  }
  return line;
}

void add_messages(const std::vector<SentMessage>& messages, std::uint64_t begin_tick, double period_s,
                  regression::CaseResult& result) {
  for (const SentMessage& each : messages) {
    const double at_s = (static_cast<double>(each.tick) - static_cast<double>(begin_tick)) * period_s;
    result.messages.push_back(fmt::format("{:.6g} s: {}", at_s, each.text));
    if (each.problem.empty()) continue;
    result.verdict = regression::Verdict::kError;
    result.reason += fmt::format("{}{} at {:.6g} s did not arrive: {}", result.reason.empty() ? "" : "; ",
                                 each.text, at_s, each.problem);
  }
}

std::string tail_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  std::string all = text.str();
  if (all.size() > kMostOutput) all.erase(0, all.size() - kMostOutput);
  return all;
}

fs::path recording_in(const fs::path& folder) {
  return folder / "run.mcap";
}

}  // namespace drivebench::command
