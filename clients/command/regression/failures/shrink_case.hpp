#pragma once

#include <cstddef>
#include <string>

#include "clients/regression/suite/case.hpp"

namespace drivebench::command {

struct ShrinkOptions {
  std::string file;       ///< of the smaller case; does not exist
  std::size_t most_runs;  ///< of the case
};

/// Makes a case that fails smaller, and writes it into the folder of the case. Returns the exit code: 0, the
/// smaller case fails as the first one did; 1, it does not each time. When the user interrupts the search,
/// the smallest case so far is written. Throws UsageError.
int run_shrink(const ShrinkOptions& options, const regression::Case& c);

/// The same for the case of a bundle, whose files get into the folder of the smaller case. The bench must be
/// known by its name.
int run_shrink_bundle(const ShrinkOptions& options, const std::string& bundle);

}  // namespace drivebench::command
