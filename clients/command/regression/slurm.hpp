#pragma once

#include <filesystem>
#include <string>

#include "clients/command/regression/test.hpp"

namespace drivebench::command {

/// Writes `slurm.sbatch` into the folder of the results, an array of tasks that share the chosen cases, and
/// submits it with sbatch. The number of the job stands in `slurm.job` then. Throws UsageError if Slurm does
/// not take it. Returns the exit code.
int submit_to_slurm(const TestOptions& options, const std::filesystem::path& suite);

/// The script of the array, for /bin/sh. Throws UsageError for a folder that sbatch cannot name.
std::string sbatch_script(const TestOptions& options, const std::filesystem::path& suite,
                          const std::filesystem::path& program, const std::filesystem::path& here);

/// What squeue says about the job of this folder, in a sentence; empty: no job was submitted.
std::string slurm_state(const std::filesystem::path& results);

}  // namespace drivebench::command
