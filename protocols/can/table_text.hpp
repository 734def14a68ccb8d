#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/profile.hpp"

namespace drivebench::can {

/// The messages of a profile in Markdown: identifiers, fields, an example of each frame with its bytes, and
/// how to decode recorded frames.
std::string table_text(std::string_view bench, const Profile& profile, std::span<const BusAxis> axes);

// ---- shared with the DBC file ----

struct Choice {
  unsigned number;
  std::string_view label;
};
/// The choices that the meaning of a field lists; none unless its unit is "enum".
std::vector<Choice> choices_of(const Field& field);

struct Range {
  double minimum;
  double maximum;
};
/// The range of a field, in its unit; for a single the usual range of its signal, if it carries one.
std::optional<Range> range_of(const Field& field, const Profile& profile);

/// The rows of the table that exist on a bus.
std::vector<const MessageRow*> rows_of(const Profile& profile);
/// The rows that these axes use; without axes, those of one narrow axis.
std::vector<const MessageRow*> rows_of(const Profile& profile, std::span<const BusAxis> axes);
/// The lowest version that covers all these axes.
unsigned version_of(const Profile& profile, std::span<const BusAxis> axes);

/// The number, rounded to `digits` digits.
std::string number_text(double value, int digits);

}  // namespace drivebench::can
