#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <cstddef>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "clients/command/experiment/experiment_fields.hpp"
#include "clients/command/experiment/experiment_file.hpp"

namespace drivebench::command {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

std::string inline_table(const Message& message);

/// A basic string of TOML; fields hold no control characters.
std::string basic_string(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + '"';
}

/// One value of a field; `index` < 0: the field is not repeated.
std::string value_text(const Message& message, const FieldDescriptor& field, int index) {
  const auto& r = *message.GetReflection();
  const bool single = index < 0;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return fmt::format("{}",
                         single ? r.GetDouble(message, &field) : r.GetRepeatedDouble(message, &field, index));
    case FieldDescriptor::CPPTYPE_UINT32:
      return fmt::format("{}",
                         single ? r.GetUInt32(message, &field) : r.GetRepeatedUInt32(message, &field, index));
    case FieldDescriptor::CPPTYPE_UINT64:
      return fmt::format("{}",
                         single ? r.GetUInt64(message, &field) : r.GetRepeatedUInt64(message, &field, index));
    case FieldDescriptor::CPPTYPE_BOOL:
      return (single ? r.GetBool(message, &field) : r.GetRepeatedBool(message, &field, index)) ? "true"
                                                                                               : "false";
    case FieldDescriptor::CPPTYPE_ENUM:
      return basic_string(
          enum_word(*(single ? r.GetEnum(message, &field) : r.GetRepeatedEnum(message, &field, index))));
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return inline_table(single ? r.GetMessage(message, &field)
                                 : r.GetRepeatedMessage(message, &field, index));
    default:
      return basic_string(single ? r.GetString(message, &field)
                                 : r.GetRepeatedString(message, &field, index));
  }
}

/// The fields that are not zero; of a named value both.
std::vector<const FieldDescriptor*> fields_of(const Message& message) {
  std::vector<const FieldDescriptor*> fields;
  if (message.GetDescriptor() == v1::NamedValue::descriptor())
    return {message.GetDescriptor()->field(0), message.GetDescriptor()->field(1)};
  message.GetReflection()->ListFields(message, &fields);
  std::erase_if(fields, [](const FieldDescriptor* field) { return is_hidden(*field); });
  return fields;
}

/// "name = value", an array for a repeated field.
std::string pair_text(const Message& message, const FieldDescriptor& field) {
  if (!field.is_repeated()) return fmt::format("{} = {}", field.name(), value_text(message, field, -1));
  const int count = message.GetReflection()->FieldSize(message, &field);
  std::vector<std::string> values;
  values.reserve(static_cast<std::size_t>(count));
  for (int k = 0; k < count; ++k)
    values.push_back(value_text(message, field, k));
  return fmt::format("{} = [{}]", field.name(), fmt::join(values, ", "));
}

std::string inline_table(const Message& message) {
  const std::vector<const FieldDescriptor*> fields = fields_of(message);
  std::vector<std::string> pairs;
  pairs.reserve(fields.size());
  for (const FieldDescriptor* field : fields)
    pairs.push_back(pair_text(message, *field));
  return fmt::format("{{ {} }}", fmt::join(pairs, ", "));
}

/// The keys of a table, then its sub-tables and arrays of tables as sections; `name` is that of the table
/// with its dot. Tables in an array of tables stand in a line.
std::string table_text(const Message& message, const std::string& name) {
  std::string keys;
  std::string sections;
  for (const FieldDescriptor* field : fields_of(message)) {
    const auto& reflection = *message.GetReflection();
    if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) {
      keys += pair_text(message, *field) + '\n';
    } else if (!field->is_repeated()) {
      sections += fmt::format("\n[{}{}]\n{}", name, field->name(),
                              table_text(reflection.GetMessage(message, field), name + field->name() + "."));
    } else {
      for (int k = 0; k < reflection.FieldSize(message, field); ++k) {
        const Message& element = reflection.GetRepeatedMessage(message, field, k);
        sections += fmt::format("\n[[{}{}]]\n", name, field->name());
        for (const FieldDescriptor* inner : fields_of(element))
          sections += pair_text(element, *inner) + '\n';
      }
    }
  }
  return keys + sections;
}

}  // namespace

std::string to_toml(const ExperimentFile& file, std::string_view comment) {
  std::string text;
  std::istringstream lines{std::string(comment)};
  for (std::string line; std::getline(lines, line);)
    text += fmt::format("# {}\n", line);
  return text + fmt::format("axis = {}\n", basic_string(file.axis)) + table_text(file.request, "");
}

}  // namespace drivebench::command
