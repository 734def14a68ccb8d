#pragma once

#include "clients/command/regression/cases/prepared_case.hpp"

namespace drivebench::command {

/// A case whose tubes around reference controllers have their runs: each drives the bench of the case, with
/// its steps, in this process.
class ReferencedCase {
 public:
  explicit ReferencedCase(const PreparedCase& prepared);
  ReferencedCase(const ReferencedCase&) = delete;
  ReferencedCase& operator=(const ReferencedCase&) = delete;

  const PreparedCase& prepared() const noexcept { return prepared_; }

 private:
  PreparedCase prepared_;
  regression::Case what_;  ///< a copy, if there are such tubes
};

/// The presets of these tubes must exist and fit the bench; what does not goes to the list.
void check_references(const PreparedCase& prepared, ProblemList& problems);

}  // namespace drivebench::command
