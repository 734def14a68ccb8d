#include "clients/command/bench/state.hpp"

#include <fmt/core.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "clients/command/bench/bench_json.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/session/session.hpp"
#include "protocols/document.hpp"

namespace drivebench::command {
namespace {

// Far above the state of a bench with all axes that there can be.
constexpr std::size_t kLargestState = std::size_t{16} << 20;

void tell(bool json, const link::Link& link, const char* done, std::uint64_t tick, const std::string& more) {
  if (json) {
    fmt::print("{}\n", state_json(done, tick, more));
    return;
  }
  const v1::BenchDescription& bench = link.welcome().bench();
  fmt::print("bench {} at {}: {} tick {} ({:.6g} s){}\n", bench.name(), link.peer(), done, tick,
             static_cast<double>(tick) * bench.period_s(), more.empty() ? "" : ", " + more);
}

/// A file in memory that the server, which this process becomes, can read.
std::string in_memory(std::string_view state) {
  const int file = ::memfd_create("state", 0);
  if (file < 0 || ::write(file, state.data(), state.size()) != static_cast<ssize_t>(state.size())) {
    throw std::system_error(errno, std::generic_category(), "cannot keep the state in memory");
  }
  return fmt::format("/proc/self/fd/{}", file);
}

}  // namespace

int run_save(const SaveOptions& options) {
  if (std::filesystem::exists(options.file)) {
    throw UsageError(fmt::format("{} exists already", options.file));
  }
  link::Link bench = open_link(options.link, "save");
  const link::SavedState saved = bench.save_state();
  Output file(options.file);
  file.write(saved.state);
  file.flush();
  tell(options.json, bench, "saved", saved.tick, options.file);
  return kExitOk;
}

int run_restore(const RestoreOptions& options) {
  const FileText file = read_file(options.file, kLargestState);
  if (!file.why_not.empty()) throw UsageError(fmt::format("{} {}", options.file, file.why_not));
  link::Link bench = open_link(options.link, "restore");
  tell(options.json, bench, "restored", bench.restore_state(file.text), options.file);
  return kExitOk;
}

int run_reset(const ResetOptions& options) {
  link::Link bench = open_link(options.link, "reset");
  bench.reset();
  tell(options.json, bench, "reset to", 0, "");
  return kExitOk;
}

int run_branch(const BranchOptions& options) {
  std::vector<std::string> server = {server_executable().string(), find_config(options.config).string(),
                                     "--from"};
  {
    link::Link bench = open_link(options.link, "branch");
    server.push_back(in_memory(bench.save_state().state));
  }
  server.insert(server.end(), options.arguments.begin(), options.arguments.end());
  replace_process(server);
}

}  // namespace drivebench::command
