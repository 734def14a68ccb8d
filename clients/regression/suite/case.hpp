#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/regression/checks/check.hpp"
#include "protocols/document.hpp"

namespace drivebench::regression {

/// What drives the axis during a case.
struct DeviceUnderTest {
  enum class Kind {
    kNone,     ///< the gates stay off
    kPreset,   ///< a controller of `drivebench control`
    kProgram,  ///< a process with its link in the environment variable DRIVEBENCH_LINK
    kAttached  ///< a drive that runs already, and finds the bench by itself
  };
  Kind kind = Kind::kNone;
  int line = 1;
  std::string preset{};
  std::vector<std::pair<std::string, double>> gains{};
  std::vector<std::string> command{};
  enum class Link { kUnix, kTcp, kSharedMemory, kCan, kModbus };
  Link link = Link::kUnix;  ///< of a program, or to the bench at which an attached drive waits
  ConfigNode place{};       ///< of an attached drive: the table of that link, as in a bench file
  std::string axis = "0";
  double time_limit_s = 60.0;  ///< of the wall clock: a program must end in it, an attached drive arm
};

/// An input that the bench gives itself, or a message to the device under test: at a time, or on a condition.
struct Step {
  enum class Action { kLoad, kParameter, kFault, kImpulse, kMultisine, kMessage };
  int line = 0;
  std::string axis = "0";
  std::optional<double> at_s{};
  std::optional<CaseCondition> when{};
  double for_s = 0.0;
  double delay_s = 0.0;
  Action action = Action::kLoad;
  std::string name{};  ///< of the parameter or the fault
  ConfigNode value{};  ///< a scalar; of a parameter also a word or a switch
  double ramp_s = 0.0;
  ConfigNode message{};                    ///< the key of its kind, `line`, `can` or `modbus`, with its value
  ConfigNode multisine{};                  ///< the table of the event, without its time
  std::optional<Excitation> excitation{};  ///< what checks need of it
};

/// One case: a bench, what drives it, what happens to it, and what must hold.
struct Case {
  std::string name;  ///< the file without its suffix, and in brackets the values of its matrix
  std::string file;
  int line = 1;
  std::vector<std::pair<std::string, std::string>> values{};  ///< of the matrix, by short names
  std::string bench;
  ConfigNode overrides{};
  std::optional<std::int64_t> seed{};
  std::optional<double> duration_s{};
  bool is_realtime = false;
  std::string skip{};  ///< the reason; empty: it runs
  std::vector<std::string> tags{};
  DeviceUnderTest device{};
  std::vector<Step> steps{};
  std::vector<CheckSpec> checks{};
};

}  // namespace drivebench::regression
