#include "protocols/can/dbc.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <vector>

#include "protocols/can/table_text.hpp"
#include "protocols/text.hpp"

namespace drivebench::can {
namespace {

constexpr std::size_t kMaxSymbol = 32;  // the longest name that every reader accepts
constexpr std::uint32_t kExtendedFlag = 0x80000000;

/// Names of the attribute VFrameFormat, indexed by its value.
constexpr auto kFrameFormats =
    std::to_array<std::string_view>({"StandardCAN", "ExtendedCAN", "reserved", "J1939PG", "reserved",
                                     "reserved", "reserved", "reserved", "reserved", "reserved", "reserved",
                                     "reserved", "reserved", "reserved", "StandardCAN_FD", "ExtendedCAN_FD"});

struct Entry {
  const MessageRow* row;
  std::string id;
  std::string name;
  std::string axis;  ///< empty if the message belongs to no axis
};

constexpr std::size_t longest_name() {
  std::size_t longest = 0;
  for (const MessageRow& row : kMessages)
    longest = std::max(longest, row.name.size());
  return longest;
}

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// The prefix of an axis' message names: a DBC identifier that no other axis has.
std::string symbol_of(const BusAxis& axis, std::set<std::string>& taken) {
  constexpr std::size_t kRoom = kMaxSymbol - 1 - longest_name();
  std::string symbol = axis.name.substr(0, kRoom);
  for (char& c : symbol) {
    if (!is_letter(c) && !is_digit(c)) c = '_';
  }
  if (symbol.empty() || is_digit(symbol[0])) symbol = ("_" + symbol).substr(0, kRoom);
  if (taken.contains(symbol)) symbol = "node" + std::to_string(axis.node);
  while (!taken.insert(symbol).second)
    symbol = "_" + symbol;
  return symbol;
}

/// The text in quotation marks, reduced to printable ASCII without quotation marks.
std::string quoted(std::string_view text) {
  std::string out(text);
  for (char& c : out) {
    if (c < ' ' || c > '~') c = '?';
    if (c == '"' || c == '\\') c = '\'';
  }
  return '"' + out + '"';
}

std::vector<Entry> entries_of(const Profile& profile, std::span<const BusAxis> axes) {
  std::vector<Entry> entries;
  const auto add = [&](const MessageRow& row, std::uint32_t node, std::string name, const std::string& axis) {
    const std::uint32_t id = profile.id_of(row, node) | (profile.extended ? kExtendedFlag : 0);
    entries.push_back({&row, std::to_string(id), std::move(name), axis});
  };
  for (const MessageRow* row : rows_of(profile, axes)) {
    if (!row->per_node) add(*row, 0, std::string(row->name), "");
  }
  std::set<std::string> taken;
  for (const BusAxis& axis : axes) {
    const std::string symbol = symbol_of(axis, taken);
    for (const MessageRow* row : rows_of(profile, {&axis, 1})) {
      if (row->per_node) add(*row, axis.node, symbol + "_" + std::string(row->name), axis.name);
    }
  }
  return entries;
}

std::string unit_text(const Field& field) {
  const bool has_unit = field.unit != "1" && field.unit != "bits" && field.unit != "enum";
  return quoted(has_unit ? field.unit : "");
}

bool is_signed(const Field& field) {
  return field.encoding == Encoding::kSigned || field.encoding == Encoding::kScaled ||
         field.encoding == Encoding::kFloat;
}

/// The DBC multiplexer mark of a field of a message with pages, or with set-points, whose mode is the page.
std::string page_text(const Field& field, const MessageRow& row) {
  if (field.page != kEveryPage) return " m" + std::to_string(field.page);
  const bool has_setpoints = std::ranges::any_of(row.fields, &Field::is_setpoint);
  return (is_paged(row) && field.name == "page") || (has_setpoints && field.name == "mode") ? " M" : "";
}

std::string signal_line(const Field& field, const Profile& profile, const MessageRow& row) {
  const Range range = range_of(field, profile).value_or(Range{0.0, 0.0});  // 0 to 0: unknown
  return " SG_ " + std::string(field.name) + page_text(field, row) + " : " + std::to_string(field.start_bit) +
         "|" + std::to_string(field.bits) + "@1" + (is_signed(field) ? "-" : "+") + " (" +
         shortest(profile.unit_of(field.scale)) + ",0) [" + number_text(range.minimum, 10) + "|" +
         number_text(range.maximum, 10) + "] " + unit_text(field) +
         (row.sender == Sender::kBench ? " Controller\n" : " Bench\n");
}

std::string no_value_words(const Field& field) {
  if (field.encoding == Encoding::kScaled) return "; the lowest number: no value";
  if (field.encoding == Encoding::kUScaled) return "; all ones: no value";
  return field.encoding == Encoding::kFloat ? "; NaN: no value" : "";
}

/// The names of bits, which a table of values gives to single ones alone.
std::string bits_text(const Field& field, std::span<const BitWord> words) {
  if (field.unit != "bits" || std::ranges::find(words, field.signal, &BitWord::signal) == words.end())
    return "";
  std::string text;
  for (const Choice& bit : choices_of(field, words))
    text += (text.empty() ? ": " : ", ") + std::to_string(bit.number) + " " + std::string(bit.label);
  return text;
}

std::string comments(const Entry& entry, std::span<const BitWord> words) {
  const MessageRow& row = *entry.row;
  std::string about = entry.axis.empty() ? std::string() : "axis " + entry.axis + ": ";
  about += row.meaning;
  if (row.message == Message::kEdges) {
    about +=
        "; not described here: from byte " + std::to_string(kFirstEdgeByte) + " on " +
        std::to_string(kEdgesPerFrame) +
        " edges of 16 bits, bits 0 to 14 the time in units of the sample period/32768, bit 15 counts down";
  }
  std::string text = "CM_ BO_ " + entry.id + " " + quoted(about) + ";\n";
  for (const Field& field : fields_of(row)) {
    text += "CM_ SG_ " + entry.id + " " + std::string(field.name) + " " +
            quoted(std::string(field.meaning) + bits_text(field, words) + no_value_words(field)) + ";\n";
  }
  return text;
}

std::string value_lists(const Entry& entry, std::span<const BitWord> words) {
  std::string text;
  for (const Field& field : entry.row->fields) {
    const std::vector<Choice> choices = choices_of(field, words);
    if (choices.empty()) continue;
    text += "VAL_ " + entry.id + " " + std::string(field.name);
    for (const Choice& choice : choices)
      text += " " + std::to_string(choice.number) + " " + quoted(choice.label);
    text += " ;\n";
  }
  return text;
}

/// The cycle times of the periodic messages; frames of all axes share a rate.
std::string cycle_times(std::span<const Entry> entries, std::span<const MessageLoad> periodic) {
  if (periodic.empty()) return {};
  std::string text =
      "BA_DEF_ BO_ \"GenMsgCycleTime\" FLOAT 0 1000000000;\nBA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n";
  constexpr double kMilliseconds = 1e3;
  for (const Entry& entry : entries) {
    const auto load = std::ranges::find(periodic, entry.row, &MessageLoad::row);
    if (load == periodic.end() || !(load->frames_per_s > 0.0)) continue;
    const auto sharing = static_cast<double>(std::ranges::count(entries, entry.row, &Entry::row));
    text += "BA_ \"GenMsgCycleTime\" BO_ " + entry.id + " " +
            number_text(kMilliseconds * sharing / load->frames_per_s, 6) + ";\n";
  }
  return text;
}

std::string attributes(std::string_view bench, const Profile& profile, std::span<const Entry> entries) {
  std::string text =
      "BA_DEF_ \"BusType\" STRING ;\nBA_DEF_ \"DBName\" STRING ;\nBA_DEF_ BO_ \"VFrameFormat\" ENUM ";
  for (std::size_t i = 0; i < kFrameFormats.size(); ++i)
    text += (i == 0 ? "" : ",") + quoted(kFrameFormats[i]);
  text += ";\nBA_DEF_DEF_ \"BusType\" \"CAN\";\nBA_DEF_DEF_ \"DBName\" \"\";\n";
  text += "BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n";
  text += std::string("BA_ \"BusType\" ") + (profile.fd ? "\"CAN FD\"" : "\"CAN\"") + ";\n";
  text += "BA_ \"DBName\" " + quoted(bench) + ";\n";
  const int format = (profile.fd ? 14 : 0) + (profile.extended ? 1 : 0);
  for (const Entry& entry : entries)
    text += "BA_ \"VFrameFormat\" BO_ " + entry.id + " " + std::to_string(format) + ";\n";
  return text;
}

}  // namespace

std::string dbc_text(std::string_view bench, const Profile& profile, std::span<const BusAxis> axes,
                     std::span<const MessageLoad> periodic, std::span<const BitWord> words) {
  const std::vector<Entry> entries = entries_of(profile, axes);
  std::string text = "VERSION \"" + std::to_string(version_of(profile, axes)) + "\"\n\nNS_ :\n\nBS_:\n\n";
  text += "BU_: Bench Controller\n\n";
  std::string about;
  std::string values;
  std::string singles;
  for (const Entry& entry : entries) {
    const MessageRow& row = *entry.row;
    text += "BO_ " + entry.id + " " + entry.name + ": " + std::to_string(row.size) +
            (row.sender == Sender::kBench ? " Bench\n" : " Controller\n");
    for (const Field& field : fields_of(row)) {
      text += signal_line(field, profile, row);
      if (field.encoding == Encoding::kFloat)
        singles += "SIG_VALTYPE_ " + entry.id + " " + std::string(field.name) + " : 1;\n";
    }
    text += "\n";
    about += comments(entry, words);
    values += value_lists(entry, words);
  }
  text += "CM_ " + quoted("CAN messages of " + std::string(bench) + ", written by drivebench.") + ";\n";
  return text + about + attributes(bench, profile, entries) + cycle_times(entries, periodic) + values +
         singles;
}

}  // namespace drivebench::can
