#include "clients/command/regression/slurm.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kClusterPatience{60};  ///< for the controller of the cluster
constexpr int kNoSuchProgram = 127;

/// A word for /bin/sh.
std::string in_shell(const std::string& word) {
  std::string text = "'";
  for (const char c : word)
    text += c == '\'' ? "'\\''" : std::string(1, c);
  return text + "'";
}

/// A program of Slurm, and what it printed.
struct SlurmAnswer {
  int code;
  std::vector<std::string> lines;
};

SlurmAnswer answer_of(const std::vector<std::string>& arguments, const std::string& error_file) {
  Process process(arguments, {.error_file = error_file});
  const Process::Deadline deadline = Process::in(kClusterPatience);
  SlurmAnswer answer{.code = 0, .lines = {}};
  while (std::optional<std::string> line = process.read_line(deadline))
    answer.lines.push_back(std::move(*line));
  const std::optional<int> code = process.wait(deadline);
  if (!code)
    throw UsageError(fmt::format("{} has not answered within {} s", arguments[0], kClusterPatience.count()));
  answer.code = *code;
  return answer;
}

fs::path job_file(const fs::path& results) {
  return results / "slurm.job";
}

}  // namespace

std::string sbatch_script(const TestOptions& options, const fs::path& suite, const fs::path& program,
                          const fs::path& here) {
  const std::string results = fs::absolute(options.results_folder).lexically_normal().string();
  if (results.find_first_of("\"\\\n") != std::string::npos) {
    throw UsageError(fmt::format(
        "--results: {} has characters that a script of Slurm cannot have in a folder", printable(results)));
  }
  std::string command = fmt::format("exec {} test {} --shard auto --results {} --jobs {}", in_shell(program),
                                    in_shell(fs::absolute(suite)), in_shell(results), options.jobs);
  if (options.retries != 0) command += fmt::format(" --retries {}", options.retries);
  if (!options.filter.empty()) command += " --filter " + in_shell(options.filter);
  for (const std::string& tag : options.wanted_tags)
    command += " --tag " + in_shell(tag);
  if (!options.keep_folder.empty()) command += " --keep " + in_shell(fs::absolute(options.keep_folder));
  return fmt::format(
      "#!/bin/sh\n"
      "# Cases without a result run, so this may be submitted again.\n"
      "#SBATCH --job-name=drivebench-test\n"
      "#SBATCH --array=1-{}\n"
      "#SBATCH --cpus-per-task={}\n"
      "#SBATCH --requeue\n"
      "#SBATCH --open-mode=append\n"
      "#SBATCH --chdir=\"{}\"\n"
      "#SBATCH --output=slurm-%a.out\n"
      "cd {} || exit\n"
      "{}\n",
      options.slurm_tasks, options.jobs, results, in_shell(here), command);
}

int submit_to_slurm(const TestOptions& options, const fs::path& suite) {
  const fs::path results = options.results_folder;
  std::error_code error;
  fs::create_directories(results, error);
  const fs::path script = results / "slurm.sbatch";
  write_file(script, sbatch_script(options, suite, own_executable(), fs::current_path()));
  const SlurmAnswer answer = answer_of({"sbatch", "--parsable", script.string()}, "");
  if (answer.code == kNoSuchProgram)
    throw UsageError("--slurm: this machine has no sbatch, the program of Slurm that takes jobs");
  // JOB, or JOB;CLUSTER
  const std::string job =
      answer.lines.empty() ? "" : answer.lines.back().substr(0, answer.lines.back().find(';'));
  if (answer.code != 0 || job.empty() || job.find_first_not_of("0123456789") != std::string::npos)
    throw UsageError(fmt::format("--slurm: sbatch has not taken {}", script.string()));
  write_file(job_file(results), job + "\n");
  fmt::print(
      "Slurm job {}: {} tasks; then\n  drivebench test {} --results {} --status\n  drivebench test {} "
      "--merge {}\n",
      job, options.slurm_tasks, in_shell(options.suite), in_shell(options.results_folder),
      in_shell(options.suite), in_shell(options.results_folder));
  return kExitOk;
}

std::string slurm_state(const fs::path& results) {
  std::ifstream in(job_file(results));
  std::string job;
  if (!(in >> job) || job.find_first_not_of("0123456789") != std::string::npos) return {};
  // Of all jobs: a question for one that Slurm has forgotten fails like one without an answer.
  const SlurmAnswer answer = answer_of({"squeue", "--noheader", "--array", "--format=%F %T"}, "/dev/null");
  if (answer.code == kNoSuchProgram) return fmt::format("Slurm job {}: this machine has no squeue", job);
  if (answer.code != 0) return fmt::format("Slurm job {}: squeue reaches no controller", job);
  std::map<std::string, int> tasks;  // by their state
  for (const std::string& line : answer.lines) {
    if (!line.starts_with(job + " ")) continue;
    std::string state = printable(line.substr(job.size() + 1));
    std::ranges::transform(state, state.begin(),
                           [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
    ++tasks[state];
  }
  if (tasks.empty()) return fmt::format("Slurm job {} has ended", job);
  std::string text;
  for (const auto& [state, count] : tasks)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, state);
  return fmt::format("Slurm job {}: {}", job, text);
}

}  // namespace drivebench::command
