#pragma once

#include <string>
#include <vector>

#include "clients/command/common/session/link_choice.hpp"

/// Verbs about the whole state of a bench: bench.proto says what it is.
namespace drivebench::command {

/// Writes the state of a running bench to a new file.
struct SaveOptions {
  LinkChoice link{};
  bool json = false;
  std::string file{};
};
int run_save(const SaveOptions& options);

/// Brings a running bench to a saved state.
struct RestoreOptions {
  LinkChoice link{};
  bool json = false;
  std::string file{};
};
int run_restore(const RestoreOptions& options);

/// Brings a running bench back to tick 0.
struct ResetOptions {
  LinkChoice link{};
  bool json = false;
};
int run_reset(const ResetOptions& options);

/// Becomes a second server that goes on from the present state of a running one.
struct BranchOptions {
  LinkChoice link{};
  std::string config{};
  std::vector<std::string> arguments{};  ///< of drivebench-server
};
int run_branch(const BranchOptions& options);

}  // namespace drivebench::command
