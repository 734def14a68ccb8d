#pragma once

#include <string>

#include "clients/command/common/session/link_choice.hpp"

/// Verbs that change an axis without controlling it.
namespace drivebench::command {

/// Injects a fault into an axis; the value 0 ends it.
struct InjectOptions {
  LinkChoice link{};
  bool json = false;
  std::string axis{};  ///< number or name
  std::string fault{};
  std::string value{};  ///< a number
};
int run_inject(const InjectOptions& options);

/// Writes a parameter.
struct SetOptions {
  LinkChoice link{};
  bool json = false;
  std::string axis{};  ///< number or name
  std::string name{};
  std::string value{};  ///< a number, a word of a choice, or true or false
  double ramp_s = 0.0;  ///< in the bench's time; 0: a step
};
int run_set(const SetOptions& options);

/// Puts a torque impulse on the shaft.
struct BumpOptions {
  LinkChoice link{};
  bool json = false;
  std::string axis{};         ///< number or name
  std::string impulse_nms{};  ///< a number
};
int run_bump(const BumpOptions& options);

/// Clears the latched faults of an axis.
struct ClearOptions {
  LinkChoice link{};
  bool json = false;
  std::string axis{};  ///< number or name
};
int run_clear(const ClearOptions& options);

/// Takes an axis from the session that holds it and leaves it free.
struct TakeOptions {
  LinkChoice link{};
  bool json = false;
  std::string axis = "0";  ///< number or name
  bool force = false;
  std::string reason{};  ///< sent to that session and kept in the server's audit log
};
int run_take(const TakeOptions& options);

}  // namespace drivebench::command
