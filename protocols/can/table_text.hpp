#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/profile.hpp"

namespace drivebench::can {

/// The messages of a profile for people, in Markdown: identifiers, fields, an example of each frame with its
/// bytes, and how to take recorded frames apart.
std::string table_text(std::string_view bench, const Profile& profile, std::span<const BusAxis> axes);

// ---- what the DBC file says as well ----

struct Choice {
  unsigned number;
  std::string_view label;
};
/// What the meaning of a field lists; nothing unless its unit is "enum".
std::vector<Choice> choices_of(const Field& field);

struct Range {
  double minimum;
  double maximum;
};
/// What a field can carry, in its unit; of a single the usual range of its signal, or nothing.
std::optional<Range> range_of(const Field& field, const Profile& profile);

/// The rows of the table that there are on a bus.
std::vector<const MessageRow*> rows_of(const Profile& profile);
/// Those of them that these axes use, one narrow axis if there are none.
std::vector<const MessageRow*> rows_of(const Profile& profile, std::span<const BusAxis> axes);
/// The version that is all these axes speak.
unsigned version_of(std::span<const BusAxis> axes);

/// As short as reads back the same, or rounded to so many digits.
std::string number_text(double value);
std::string number_text(double value, int digits);

}  // namespace drivebench::can
