#include "protocols/can/table_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "protocols/can/codec.hpp"
#include "protocols/can/formats/text.hpp"
#include "protocols/signals/catalogue.hpp"
#include "protocols/text.hpp"

namespace drivebench::can {
namespace {

constexpr std::string_view kHowToDissect = R"(## Recorded frames

`candump -L can0 > run.log` records a bus. `drivebench dbc` writes the same table as a DBC file, which most CAN programs read:

* Python, with python-can and canmatrix:

```python
import can, canmatrix.formats
matrix = canmatrix.formats.loadp_flat("bench.dbc")
for message in can.LogReader("run.log"):
    frame = matrix.frame_by_id(canmatrix.ArbitrationId(message.arbitration_id, message.is_extended_id))
    if frame:
        print(message.timestamp, frame.name, {name: str(field.phys_value) for name, field in frame.decode(bytes(message.data)).items()})
```

* cantools: `candump can0 | python3 -m cantools decode bench.dbc`.
* Wireshark opens `run.log` as it is; `tshark -r run.log -Y "can.id == 0x061" -x` prints identifiers and bytes, to be read with the tables above.
)";

std::string hex(std::uint32_t value, int digits) {
  std::string text = "0x";
  append_hex(text, value, digits);
  return text;
}

std::string id_text(const Profile& profile, std::uint32_t id) {
  return hex(id, profile.extended ? 8 : 3);
}

std::string encoding_text(const Field& field, const Profile& profile) {
  const std::string bits = std::to_string(field.bits);
  const std::string times_unit = " x " + shortest(profile.unit_of(field.scale));
  switch (field.encoding) {
    case Encoding::kCounter:
      return "uint" + bits + ", wraps";
    case Encoding::kSigned:
      return "int" + bits + ", wraps";
    case Encoding::kCode:
      return "uint" + bits;
    case Encoding::kUScaled:
      return "uint" + bits + times_unit;
    case Encoding::kScaled:
      return "int" + bits + times_unit;
    case Encoding::kFloat:
      break;
  }
  return "float" + bits;
}

std::string no_value_text(const Field& field) {
  const int digits = field.bits / 4;
  if (field.encoding == Encoding::kUScaled) return hex(0xFFFFFFFF, digits);
  if (field.encoding == Encoding::kScaled) return hex(1U << (field.bits - 1U), digits);
  return field.encoding == Encoding::kFloat ? "NaN" : "-";
}

/// Adds the width where narrow and wide axes on one bus have frames of the same name.
std::string title_of(const MessageRow& row, std::span<const MessageRow* const> rows) {
  const bool twice = std::ranges::any_of(
      rows, [&](const MessageRow* other) { return other != &row && other->message == row.message; });
  const bool is_wide = row.width == Width::kWide;
  return std::string(row.name) + (!twice ? "" : is_wide ? " (wide axis)" : " (narrow axis)");
}

std::string field_line(const Field& field, const Profile& profile) {
  const std::optional<Range> range = range_of(field, profile);
  const unsigned first = field.start_bit / 8U;
  const unsigned last = first + (field.bits + 7U) / 8U - 1;
  std::string line = "| " + std::to_string(first) + (last > first ? "-" + std::to_string(last) : "");
  if (field.bits < 8) line += field.start_bit % 8U == 0 ? " low half" : " high half";
  line += " | " + std::string(field.name) + " | ";
  if (field.page != kEveryPage)
    line += (field.is_setpoint ? "mode " : "page ") + std::to_string(field.page) + ": ";
  line += encoding_text(field, profile) + " | ";
  line += std::string(field.unit == "1" ? "-" : field.unit) + " | ";
  line += range ? number_text(range->minimum, 10) + " to " + number_text(range->maximum, 10) : "any";
  line += " | " + no_value_text(field) + " | " + std::string(field.meaning) + " |\n";
  return line;
}

std::string message_text(const MessageRow& row, const Profile& profile, const std::string& title) {
  const std::uint32_t base_id = profile.base_ids[static_cast<std::size_t>(row.message)];
  std::string text = "### " + title + "\n\n";
  text += id_text(profile, base_id) + (row.per_node ? " + node, " : ", ") + std::to_string(row.size) +
          (row.size == 1 ? " byte" : " bytes") +
          (row.sender == Sender::kBench ? ", from the bench: " : ", from the controller: ") +
          std::string(row.meaning) + ".\n\n";
  text += "| bytes | field | encoding | unit | range | no value | meaning |\n|---|---|---|---|---|---|---|\n";
  for (const Field& field : fields_of(row))
    text += field_line(field, profile);
  if (row.message == Message::kEdges) {
    text += "\nFrom byte " + std::to_string(kFirstEdgeByte) + " on: " + std::to_string(kEdgesPerFrame) +
            " edges of 16 bits; bits 0 to 14 are the time since the start of the tick in units of the sample "
            "period/32768, bit 15 says that the count went down.\n";
  }
  return text + "\n";
}

std::string identifiers_text(const Profile& profile, std::span<const BusAxis> axes,
                             std::span<const MessageRow* const> rows) {
  std::string text = "## Identifiers\n\n| message | from |";
  std::string rule = "|---|---|";
  for (const BusAxis& axis : axes) {
    text += " " + axis.name + " (node " + std::to_string(axis.node) + ") |";
    rule += "---|";
  }
  text += "\n" + rule + "\n";
  for (const MessageRow* row : rows) {
    text += "| " + title_of(*row, rows) + (row->sender == Sender::kBench ? " | bench |" : " | controller |");
    for (const BusAxis& axis : axes)
      text += " " + (has_message(axis, *row) ? id_text(profile, profile.id_of(*row, axis.node)) : "-") + " |";
    text += "\n";
  }
  return text + "\n";
}

/// Example values, different for each field.
Values example_values(const MessageRow& row) {
  Sample sample;
  sample.tick = 1000;
  sample.command_tick = 999;
  sample.command_age_ticks = 1;
  sample.missed_commands = 2;
  sample.refused_commands = 3;
  sample.late_ticks = 4;
  sample.state = 1;
  sample.faults = 0x10;
  sample.encoder_count = -1234;
  sample.encoder_levels = 35;
  sample.edge_age_s = 25e-6;
  sample.edge_period_s = 150e-6;
  sample.index_count = -1200;
  sample.index_tick = 990;
  sample.i_a_a = 1.5;
  sample.i_b_a = -0.75;
  sample.speed_rad_s = -62.8;
  sample.bus_voltage_v = 320.0;
  sample.i_c_a = -0.25;
  sample.i_f_a = 2.0;
  sample.u_a_v = 12.5;
  sample.u_b_v = -6.25;
  sample.u_c_v = 25.0;
  sample.u_f_v = 48.0;
  sample.u_n_v = -1.5;
  sample.hall_lines = 5;
  sample.tachometer_v = 7.5;
  sample.resolver_sin_v = 0.5;
  sample.resolver_cos_v = -0.875;
  sample.temperature_k = 293.5;
  sample.meter_u_rms_v = 230.0;
  sample.meter_i_rms_a = 1.25;
  sample.meter_p_w = 250.0;
  sample.meter_q_var = 125.0;
  sample.meter_pf = 0.875;
  sample.injected = 0x20;
  Values values = values_of(row, sample);
  for (std::size_t i = 0; i < row.fields.size(); ++i) {
    const Field& field = row.fields[i];
    const std::vector<Choice> choices = choices_of(field);
    if (!field.signal.empty()) continue;
    if (field.unit == "enum")
      values[i] = choices[1].number;
    else if (field.encoding == Encoding::kCode)
      values[i] = 7.0;
    else
      values[i] = field.encoding == Encoding::kCounter ? 1000.0 : -6.25;
  }
  return values;
}

/// A table line; a message without pages ignores `page`.
std::string example_text(const MessageRow& row, const Profile& profile, std::uint32_t node,
                         const std::string& title, std::size_t page) {
  Values values = example_values(row);
  if (is_paged(row)) values[0] = static_cast<double>(page);
  const Frame frame = encode(row, profile, node, values);
  values = decode(row, profile, frame);
  std::string text = "| " + title + " | `";
  append_id(text, frame);
  text += frame.fd ? "##1" : "#";
  append_data(text, frame);
  text += "` |";
  for (std::size_t i = 0; i < row.fields.size(); ++i) {
    const Field& field = row.fields[i];
    if (!is_on_page(field, page)) continue;
    const bool has_unit = field.unit != "1" && field.unit != "bits" && field.unit != "enum";
    text += (i == 0 ? " " : ", ") + std::string(field.name) + " " + number_text(values[i], 7) +
            (has_unit ? " " + std::string(field.unit) : "");
  }
  return text + " |\n";
}

/// The names of bits that are too many for the line of their field.
std::string words_text(std::span<const BitWord> words) {
  std::string text;
  for (const BitWord& word : words) {
    text += "## Bits of `" + std::string(word.signal) + "`\n\n| value | name |\n|---|---|\n";
    for (const Choice& bit : word.bits)
      text += "| " + hex(bit.number, 1) + " | " + std::string(bit.label) + " |\n";
    text += "\n";
  }
  return text;
}

std::string conventions_text(const Profile& profile) {
  return std::string(profile.fd ? "CAN FD frames with bit rate switch" : "Classic CAN frames") +
         (profile.extended ? ", 29-bit identifiers" : ", 11-bit identifiers") +
         ". Little-endian: the byte that is named first holds the low bits. Bytes of no field are sent as 0 "
         "and "
         "must be 0.\n\nA field that wraps holds the low bits of its number. Others stop at the end of their "
         "range" +
         (profile.fd ? "; a number beyond the largest float32 becomes an infinity" : "") +
         ". The bits under \"no value\" say that there is none, or that it is not a number.\n\n";
}

}  // namespace

std::vector<Field> fields_of(const MessageRow& row) {
  struct Other {
    std::uint8_t mode;
    std::array<std::string_view, 4> names;  // of phases a, b, c and the field winding
    std::string_view unit;
    Unit scale;
    std::string_view meaning;
  };
  constexpr std::string_view kTerminals = "abcf";
  constexpr auto kOthers = std::to_array<Other>(
      {{kDutyMode,
        {"duty_mid_a", "duty_mid_b", "duty_mid_c", "duty_mid_f"},
        "1",
        Unit::kDuty,
        "duty from the middle of the DC link: -1 is the negative rail, 1 the positive one"},
       {kCurrentMode,
        {"i_a", "i_b", "i_c", "i_f"},
        "A",
        Unit::kCurrent,
        "current into this phase or winding"},
       {kLegDutyMode,
        {"duty_a", "duty_b", "duty_c", "duty_f"},
        "1",
        Unit::kDuty,
        "duty: of a leg from 0, the negative rail, to 1; across a winding with its own bridge from -1 to "
        "1"}});
  std::vector<Field> fields;
  for (Field field : row.fields) {
    if (field.is_setpoint) field.page = kVoltageMode;
    fields.push_back(field);
    if (!field.is_setpoint) continue;
    for (const Other& other : kOthers) {
      field.page = other.mode;
      field.name = other.names[kTerminals.find(field.name.back())];
      field.unit = other.unit;
      if (field.encoding != Encoding::kFloat) field.scale = other.scale;
      field.meaning = other.meaning;
      fields.push_back(field);
    }
  }
  return fields;
}

std::vector<Choice> choices_of(const Field& field, std::span<const BitWord> words) {
  std::vector<Choice> choices;
  const auto word = std::ranges::find(words, field.signal, &BitWord::signal);
  if (word != words.end() && !field.signal.empty()) return word->bits;
  if (field.unit != "enum" && field.unit != "bits") return choices;
  std::string_view rest = field.meaning.substr(0, field.meaning.find(':'));
  while (!rest.empty()) {
    const std::string_view part = rest.substr(0, rest.find(", "));
    rest.remove_prefix(std::min(rest.size(), part.size() + 2));
    const std::size_t space = part.find(' ');
    if (const auto number = parse_number(part.substr(0, space), 10))
      choices.push_back({*number, part.substr(space + 1)});
  }
  return choices;
}

std::optional<Range> range_of(const Field& field, const Profile& profile) {
  const double count = std::ldexp(1.0, static_cast<int>(field.bits));
  const double unit = profile.unit_of(field.scale);
  switch (field.encoding) {
    case Encoding::kCounter:
    case Encoding::kCode:
      return Range{0.0, count - 1.0};
    case Encoding::kSigned:
      return Range{-count / 2.0, count / 2.0 - 1.0};
    case Encoding::kUScaled:
      return Range{0.0, (count - 2.0) * unit};
    case Encoding::kScaled:
      return Range{(1.0 - count / 2.0) * unit, (count / 2.0 - 1.0) * unit};
    case Encoding::kFloat:
      break;
  }
  const Signal* const signal = find_signal(field.signal);
  if (signal == nullptr) return std::nullopt;
  return Range{signal->minimum, signal->maximum};
}

std::vector<const MessageRow*> rows_of(const Profile& profile) {
  std::vector<const MessageRow*> rows;
  for (const MessageRow& row : kMessages) {
    if (is_on(row, profile)) rows.push_back(&row);
  }
  return rows;
}

std::vector<const MessageRow*> rows_of(const Profile& profile, std::span<const BusAxis> axes) {
  const BusAxis narrow;
  if (axes.empty()) axes = {&narrow, 1};
  std::vector<const MessageRow*> rows;
  for (const MessageRow& row : kMessages) {
    const bool used = std::ranges::any_of(axes, [&](const BusAxis& axis) { return has_message(axis, row); });
    if (used && is_in(row, profile.fd)) rows.push_back(&row);
  }
  return rows;
}

unsigned version_of(const Profile& profile, std::span<const BusAxis> axes) {
  return version_of(profile.id_set, std::ranges::any_of(axes, &BusAxis::wide));
}

std::string number_text(double value, int digits) {
  std::array<char, 64> text{};
  return {
      text.data(),
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, digits).ptr};
}

std::string table_text(std::string_view bench, const Profile& profile, std::span<const BusAxis> axes,
                       std::span<const BitWord> words) {
  const std::vector<const MessageRow*> rows = rows_of(profile, axes);
  std::string text = "# CAN messages of " + std::string(bench) + "\n\nVersion " +
                     std::to_string(version_of(profile, axes)) + " of the profile. " +
                     conventions_text(profile);
  text += identifiers_text(profile, axes, rows);
  text += "## Fields\n\n";
  for (const MessageRow* row : rows)
    text += message_text(*row, profile, title_of(*row, rows));
  text += words_text(words);
  text +=
      "## Examples\n\nAs `cansend` takes and `candump -L` prints them, with the values that they carry.\n\n"
      "| message | frame | values |\n|---|---|---|\n";
  for (const MessageRow* row : rows) {
    const auto axis =
        std::ranges::find_if(axes, [&](const BusAxis& each) { return has_message(each, *row); });
    const std::uint32_t node = axis == axes.end() ? 1 : axis->node;
    for (std::size_t page = 0; page < (is_paged(*row) ? kPages : 1); ++page)
      text += example_text(*row, profile, node, title_of(*row, rows), page);
  }
  return text + "\n" + std::string(kHowToDissect);
}

}  // namespace drivebench::can
