#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/command/experiment/experiment_client.hpp"

namespace drivebench::command {

/// The limits of a suggested experiment.
struct SuggestOptions {
  std::optional<double> current_a{};  ///< nothing: that of the bench's amplifier
  std::optional<double> voltage_v{};  ///< the same; of a phase, or of the armature
  std::optional<double> speed_rad_s{};
  std::optional<double> duration_s{};  ///< nothing: that of the motor's first experiment
  int trials = 40;
  std::string file{};  ///< TOML; empty: standard output
};

/// A motor identified from an experiment on a bench, or from a file.
struct IdentifyOptions {
  ExperimentServer server{};
  bool link_was_named = false;  ///< the command line names the link: uses no other bench
  bool json = false;
  bool suggest = false;
  SuggestOptions suggestion{};
  bool list = false;  ///< print motors and experiments and end
  std::string motor{};
  std::string experiment{};  ///< name, or file; empty: the first of the motor
  std::string bench{};  ///< starts a server on this bench, by path or name; empty: that of the experiment

  std::string from_file{};          ///< a recording (.mcap) or CSV instead of an experiment
  std::vector<std::string> maps{};  ///< of CSV: HEADER=SIGNAL or a column-map file
  std::string time{};               ///< of CSV: header of the time; empty: time_s
  std::optional<double> period_s{};
  std::vector<std::string> find{};  ///< current-offsets, voltage-offsets, gains
  std::string axis{};               ///< of a recording: name; empty: the first in the file

  std::optional<int> pole_pairs{};
  std::optional<double> counts_per_revolution{};
  std::optional<int> phases{};
  std::string direction{};  ///< of the encoder: forward or reversed; empty: as found
  std::string voltages{};   ///< mean or instant; empty: that of the data's source
  std::optional<double> voltage_shift{};
  std::string window{};  ///< FROM:TO [s]
  std::optional<double> current_hz{};
  std::optional<double> voltage_hz{};
  std::optional<double> shaft_hz{};
  std::optional<int> order{};
  std::string load{};  ///< viscous or constant; empty: that of the experiment
  bool one_stage = false;
  std::optional<double> stator_resistance_ohm{};  ///< known, for a no-load or blocked-rotor test alone

  std::string markdown_file{};
  std::string plot_file{};
  std::string motor_file{};
  std::string data_file{};  ///< CSV
};

}  // namespace drivebench::command
