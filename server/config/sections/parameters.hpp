#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "plant/parameters/parameters.hpp"
#include "protocols/document.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// The motor file of an axis. It must outlive the tables that read it.
struct MotorFile {
  std::string path;
  std::filesystem::path folder;  ///< names of other files are relative to it
  std::optional<ConfigNode> document;
  std::optional<StrictTable> table;
  std::string name;
};

/// The sources of the parameters of an axis.
struct ParameterSource {
  StrictTable& axis;
  MotorFile& motor;
  bool motor_missing;               ///< the bench file names a motor file that cannot be read
  std::filesystem::path folder;     ///< of the bench file; empty: the text must not name other files
  std::vector<ConfigProblem>& odd;  ///< collects valid but implausible values
  const MechanicsParameters* shared_mechanics = nullptr;  ///< of the axis whose shaft this one shares
  const DriveParameters* shared_drive = nullptr;          ///< of the axis whose amplifier this one shares
};

/// Reads the kind of machine and every row and curve of its tables. False if a value was missing or wrong;
/// the problem is then reported.
bool read_parameters(const ParameterSource& source, ProblemList& problems, AxisParameters& p);

/// The value of a parameter; nothing if it is absent or out of its limits.
std::optional<double> read_value(StrictTable& table, std::string_view key, const Parameter& row);

/// Whether all parameters of a section are those of the drive.
bool is_section_of_drive(std::string_view section) noexcept;

/// The value in TOML.
std::string value_text(const Parameter& row, double value);

constexpr std::string_view section_of(std::string_view row) noexcept {
  return row.substr(0, row.find('.'));
}
constexpr std::string_view key_of(std::string_view row) noexcept {
  return row.substr(row.find('.') + 1);
}

}  // namespace drivebench
