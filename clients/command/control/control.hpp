#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/command/common/session/link_choice.hpp"
#include "clients/command/control/control_limits.hpp"
#include "clients/command/control/control_run.hpp"
#include "clients/control/gains/gains.hpp"

namespace drivebench::command {

struct ParameterSetting {
  std::string name;
  double value = 0.0;
  std::string written{};  ///< the value as the user wrote it
};

struct ControlOptions {
  LinkChoice link{};
  bool json = false;
  bool list = false;   ///< print the presets and end
  bool gains = false;  ///< print the gains of the preset (with --list: of all presets) and end
  std::string preset = "book/8.2.2";
  std::vector<control::Gain> overrides{};  ///< of its gains
  std::string axis = "0";                  ///< number or name
  std::string csv_file{};                  ///< empty: none
  std::vector<LoadAt> loads{};
  std::vector<ParameterSetting> settings{};
  bool clear_faults = false;
  std::vector<Limit> limits{};  ///< for the numbers of the report
  std::uint32_t repeat = 1;     ///< times; 0: until it is interrupted
  double follow = 0.0;  ///< most seconds of the bench in a second of the clock; 0: as fast as possible
};
int run_control(const ControlOptions& options);

}  // namespace drivebench::command
