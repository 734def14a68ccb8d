#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "plant/parameters/parameters.hpp"
#include "protocols/document.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// The motor file of an axis: must outlive what reads it.
struct MotorFile {
  std::string path;
  std::filesystem::path folder;  ///< where the files that it names are looked for
  std::optional<ConfigNode> document;
  std::optional<StrictTable> table;
  std::string name;
};

/// Where the parameters of an axis come from.
struct ParameterSource {
  StrictTable& axis;
  MotorFile& motor;
  bool motor_missing;               ///< it is named but cannot be read
  std::filesystem::path folder;     ///< of the bench file; empty: it may name no other files
  std::vector<ConfigProblem>& odd;  ///< takes what is right and yet hardly meant
  const MechanicsParameters* shared_mechanics = nullptr;  ///< of the axis whose shaft this one shares
};

/// Reads the kind of machine and every row and curve of its tables. False if something was missing or wrong,
/// which then has been told.
bool read_parameters(const ParameterSource& source, ProblemList& problems, AxisParameters& p);

/// The value of a parameter if the table has it and it is right by itself.
std::optional<double> read_value(StrictTable& table, std::string_view key, const Parameter& row);

/// The value as configurations write it.
std::string value_text(const Parameter& row, double value);

constexpr std::string_view section_of(std::string_view row) noexcept {
  return row.substr(0, row.find('.'));
}
constexpr std::string_view key_of(std::string_view row) noexcept {
  return row.substr(row.find('.') + 1);
}

}  // namespace drivebench
