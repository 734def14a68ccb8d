#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/profile.hpp"

namespace drivebench::can {

struct Choice {
  unsigned number;
  std::string_view label;
};
/// A signal of the catalogue that is a word of bits, with their names.
struct BitWord {
  std::string_view signal;
  std::vector<Choice> bits;
};

/// The messages of a profile in Markdown: identifiers, fields, an example of each frame with its bytes, and
/// how to decode recorded frames.
std::string table_text(std::string_view bench, const Profile& profile, std::span<const BusAxis> axes,
                       std::span<const BitWord> words = {});

// ---- shared with the DBC file ----

/// The fields of a message, a set-point once for each quantity: a voltage in mode 1, a duty from the middle
/// of the link in mode 3, a current in mode 4, a duty of the leg in mode 5; `page` is then the mode.
std::vector<Field> fields_of(const MessageRow& row);

/// The numbers (unit "enum") or bits (unit "bits") that the meaning of a field lists, or `words` for its
/// signal.
std::vector<Choice> choices_of(const Field& field, std::span<const BitWord> words = {});

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
