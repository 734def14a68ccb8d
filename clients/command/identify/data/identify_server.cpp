#include "clients/command/identify/data/identify_server.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/programs/server_ready.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/experiment/experiment_client.hpp"
#include "clients/command/experiment/experiment_data.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;

/// A folder that is deleted with this object.
class OwnFolder {
 public:
  OwnFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "drivebench-identify-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr)
      throw std::system_error(errno, std::generic_category(), "cannot make the folder " + name);
    path_ = name;
  }
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;
  ~OwnFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

}  // namespace

/// drivebench-server on a bench, on a port of its own.
class OwnServer {
 public:
  explicit OwnServer(const std::string& bench)
      : process_({server_executable().string(), find_config(bench).string(), "--mode", "lockstep", "--port",
                  "0", "--experiments", folder_.path() + "/kept", "--json"}) {
    if (const auto ready = process_.await(Process::in(15s), parse_ready)) {
      address_ = ready->tcp;
      return;
    }
    if (process_.wait(Process::in(1s)) == kExitUsage) {  // the server has printed why
      throw UsageError(fmt::format("the server does not take the bench {}", bench));
    }
    throw std::runtime_error(fmt::format("the server for the bench {} did not start", bench));
  }
  OwnServer(const OwnServer&) = delete;
  OwnServer& operator=(const OwnServer&) = delete;
  ~OwnServer() {
    process_.terminate();
    try {
      process_.wait(Process::in(5s));
    } catch (const std::exception& error) {
      fmt::print(stderr, "identify: {}\n", error.what());
    }
  }
  const std::string& address() const noexcept { return address_; }

 private:
  OwnFolder folder_;
  Process process_;
  std::string address_;
};

namespace {

/// The reason why the bench behind the link does not fit; empty: it fits. Throws the error of a link that the
/// command line names.
std::string why_not(const IdentifyOptions& options, const WantedExperiment& wanted) {
  try {
    link::Link link = open_link(options.server.link, "identify");
    const v1::BenchDescription& bench = link.welcome().bench();
    const std::optional<std::uint32_t> number = find_axis(bench, wanted.file.axis);
    if (!number) {
      return fmt::format("the bench {} at {} has no axis {}, but {}", bench.name(),
                         options.server.link.address, wanted.file.axis,
                         listed(bench.axes(), &v1::AxisDescription::name));
    }
    const v1::AxisDescription& axis = bench.axes(static_cast<int>(*number));
    if (!identification::is_machine_of(axis.machine_kind(), wanted.machine))
      return fmt::format("axis {} of the bench {} is of kind {}, not {}", axis.name(), bench.name(),
                         axis.machine_kind(), wanted.machine);
    link.list_experiments("");  // without an owner: a bench that keeps no experiments refuses
  } catch (const std::runtime_error& error) {
    // No program answers, or another program, or a bench that refuses.
    if (options.link_was_named) throw;
    return error.what();
  }
  return {};
}

/// Adds the signals that identification needs to those of the file.
void add_signals(v1::RunExperiment& request, const v1::AxisDescription& axis) {
  std::vector<std::string> needed = {"encoder_count", "angle_rad", "load_nm"};
  for (unsigned k = 0; k < std::max(1U, axis.phases()); ++k) {
    needed.push_back(fmt::format("i_{}_a", static_cast<char>('a' + k)));
    needed.push_back(fmt::format("u_{}_v", static_cast<char>('a' + k)));
  }
  for (const std::string& name : needed) {
    const auto& have = request.signals();
    if (std::find(have.begin(), have.end(), name) == have.end()) request.add_signals(name);
  }
}

/// Puts the rows of an experiment into columns.
class Columns {
 public:
  explicit Columns(identification::MeasuredData& data) : data_(data) {}

  void take(const v1::ExperimentInfo& info, const v1::ExperimentData* piece) {
    if (rows_.describe(info)) {
      for (const Signal* signal : rows_.signals())
        data_.columns.push_back({std::string(signal->name), std::string(signal->unit), {}});
      data_.period_s = 1e-9 * static_cast<double>(rows_.tick_ns() * rows_.decimation());
    }
    if (piece == nullptr) return;
    rows_.take(*piece, [this](std::uint64_t, const std::vector<double>& values) {
      for (std::size_t k = 0; k < values.size(); ++k)
        data_.columns[k].values.push_back(values[k]);
    });
  }
  std::uint64_t next_tick() const noexcept { return rows_.next_tick(); }

 private:
  identification::MeasuredData& data_;
  ExperimentRows rows_;
};

/// Takes the description of the axis and adds the signals that identification needs; the name of the bench.
std::string describe_axis(ExperimentClient& client, WantedExperiment& wanted, MeasuredMotor& m) {
  std::string name;
  client.with_link([&](link::Link& link) {
    const v1::BenchDescription& bench = link.welcome().bench();
    const std::uint32_t axis = axis_number(bench, wanted.file.axis);
    name = bench.name();
    take_description(bench, axis, wanted.file.request, m);
    add_signals(wanted.file.request, bench.axes(static_cast<int>(axis)));
    m.data.period_s = bench.period_s() * m.facts.decimation;
  });
  return name;
}

MeasuredMotor run_on(const IdentifyOptions& options, const ExperimentServer& server,
                     WantedExperiment wanted) {
  MeasuredMotor m;
  ExperimentClient client(server, "identify");
  // The description is read first: the request needs signals that fit the machine.
  const std::string bench = describe_axis(client, wanted, m);
  v1::ExperimentInfo info = client.run(wanted.file);
  if (!options.json)
    fmt::print(stderr, "identify: experiment {} on the bench {}, {}\n", info.id(), bench,
               word_of(info.state()));
  Columns columns(m.data);
  info = client.fetch(
      info.id(), false,
      [&](const v1::ExperimentInfo& about, const v1::ExperimentData* piece) { columns.take(about, piece); },
      [&] { return columns.next_tick(); });
  if (info.state() != v1::EXPERIMENT_STATE_COMPLETED && info.state() != v1::EXPERIMENT_STATE_STOPPED)
    throw std::runtime_error(fmt::format("experiment {}: {}{}{}", info.id(), word_of(info.state()),
                                         info.reason().empty() ? "" : ", ", info.reason()));
  m.source = fmt::format("experiment {} ({}) on the bench {}, axis {}", info.id(), info.label(), bench,
                         wanted.file.axis);
  m.experiment = std::move(info);
  return m;
}

}  // namespace

OwnBench::OwnBench(const std::string& bench) : server_(std::make_unique<OwnServer>(bench)) {}
OwnBench::~OwnBench() = default;

ExperimentServer OwnBench::experiments() const {
  return {.link = {.address = server_->address(), .token = {}}, .owner = random_word()};
}

MeasuredMotor OwnBench::describe(WantedExperiment& wanted) const {
  MeasuredMotor m;
  ExperimentClient client(experiments(), "identify");
  describe_axis(client, wanted, m);
  return m;
}

MeasuredMotor OwnBench::measure(const IdentifyOptions& options, const WantedExperiment& wanted) const {
  return run_on(options, experiments(), wanted);
}

MeasuredMotor measure(const IdentifyOptions& options, const WantedExperiment& wanted) {
  if (!options.bench.empty()) {
    if (options.link_was_named)
      throw UsageError("--bench starts a server of our own, --link names another one");
    return OwnBench(options.bench).measure(options, wanted);
  }
  const std::string problem = why_not(options, wanted);
  if (problem.empty()) return run_on(options, options.server, wanted);
  if (options.link_was_named) throw UsageError(problem);
  if (wanted.bench.empty()) throw UsageError(problem + "; --bench names one to start, --link one that runs");
  if (!options.json) fmt::print(stderr, "identify: {}; starting a server on {}\n", problem, wanted.bench);
  return OwnBench(wanted.bench).measure(options, wanted);
}

}  // namespace drivebench::command
