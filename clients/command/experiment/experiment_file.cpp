#include "clients/command/experiment/experiment_file.hpp"

#include <fmt/core.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>

#include "clients/command/experiment/experiment_fields.hpp"
#include "protocols/document.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

/// A table has room in a request of 64 KiB.
constexpr int kRowsPerUpload = 4000;
constexpr std::size_t kMaxCsvLine = 200;
constexpr int kMaxElements = 1000;

std::string words_of(const EnumDescriptor& type) {
  std::string words;
  for (int i = 1; i < type.value_count(); ++i)
    words += (words.empty() ? "" : ", ") + enum_word(*type.value(i));
  return words;
}

std::string keys_of(const Descriptor& type) {
  std::string keys;
  for (int i = 0; i < type.field_count(); ++i) {
    if (!is_hidden(*type.field(i))) keys += (keys.empty() ? "" : ", ") + type.field(i)->name();
  }
  return keys;
}

std::optional<double> number_of(const ConfigNode& node) {
  if (const auto* real = std::get_if<double>(&node.scalar)) return *real;
  if (const auto* integer = std::get_if<std::int64_t>(&node.scalar)) return static_cast<double>(*integer);
  return std::nullopt;
}

/// Fills a message from a table by the message's own description.
class MessageReader {
 public:
  MessageReader(std::string file, ProblemList& problems) : file_(std::move(file)), problems_(problems) {}

  void read(const ConfigNode& table, const std::string& path, Message& message) {
    for (const ConfigNode& child : table.children) {
      const std::string key = path.empty() ? child.key : path + "." + child.key;
      if (path.empty() && child.key == "axis") continue;  // a name too: see parse_experiment()
      const FieldDescriptor* const field = message.GetDescriptor()->FindFieldByName(printable(child.key));
      if (field == nullptr || is_hidden(*field)) {
        report(child, key, "is not known here; there are " + keys_of(*message.GetDescriptor()));
      } else if (const auto* choice = field->real_containing_oneof();
                 choice != nullptr && message.GetReflection()->HasOneof(message, choice)) {
        report(child, key,
               "is one too many beside " +
                   message.GetReflection()->GetOneofFieldDescriptor(message, choice)->name());
      } else if (field->is_repeated()) {
        read_array(child, key, *field, message);
      } else {
        read_value(child, key, *field, message);
      }
    }
  }

 private:
  void report(const ConfigNode& node, const std::string& key, std::string rule) {
    problems_.add(file_, node.line, printable(key), std::move(rule));
  }

  void read_array(const ConfigNode& node, const std::string& key, const FieldDescriptor& field,
                  Message& message) {
    if (node.kind != ConfigNode::Kind::kArray) return report(node, key, "must be an array");
    if (node.children.size() > kMaxElements) {
      return report(node, key,
                    fmt::format("has {} elements but may have {}", node.children.size(), kMaxElements));
    }
    for (std::size_t i = 0; i < node.children.size(); ++i)
      read_value(node.children[i], fmt::format("{}[{}]", key, i), field, message);
  }

  void read_value(const ConfigNode& node, const std::string& key, const FieldDescriptor& field,
                  Message& message) {
    const auto* const reflection = message.GetReflection();
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      if (node.kind != ConfigNode::Kind::kTable) return report(node, key, "must be a table");
      Message& inner = field.is_repeated() ? *reflection->AddMessage(&message, &field)
                                           : *reflection->MutableMessage(&message, &field);
      return read(node, key, inner);
    }
    if (node.kind != ConfigNode::Kind::kScalar) {
      return report(node, key, "must be a single value");
    }
    // Set for a single field, Add for a repeated one.
    const auto put = [&](auto set, auto add, auto value) {
      if (field.is_repeated()) {
        (reflection->*add)(&message, &field, value);
      } else {
        (reflection->*set)(&message, &field, value);
      }
    };
    using Reflection = google::protobuf::Reflection;
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE: {
        const auto value = number_of(node);
        if (!value || !std::isfinite(*value)) return report(node, key, "must be a finite number");
        return put(&Reflection::SetDouble, &Reflection::AddDouble, *value);
      }
      case FieldDescriptor::CPPTYPE_UINT32:
      case FieldDescriptor::CPPTYPE_UINT64: {
        const auto* const value = std::get_if<std::int64_t>(&node.scalar);
        const bool small = field.cpp_type() == FieldDescriptor::CPPTYPE_UINT32;
        const std::int64_t most = small ? std::numeric_limits<std::uint32_t>::max() : std::int64_t{1} << 53;
        if (value == nullptr || *value < 0 || *value > most) {
          return report(node, key, fmt::format("must be a whole number from 0 to {}", most));
        }
        if (small)
          return put(&Reflection::SetUInt32, &Reflection::AddUInt32, static_cast<std::uint32_t>(*value));
        return put(&Reflection::SetUInt64, &Reflection::AddUInt64, static_cast<std::uint64_t>(*value));
      }
      case FieldDescriptor::CPPTYPE_BOOL: {
        const auto* const value = std::get_if<bool>(&node.scalar);
        if (value == nullptr) return report(node, key, "must be true or false");
        return put(&Reflection::SetBool, &Reflection::AddBool, *value);
      }
      case FieldDescriptor::CPPTYPE_ENUM:
        return read_word(node, key, field, message);
      case FieldDescriptor::CPPTYPE_STRING: {
        const auto* const value = std::get_if<std::string>(&node.scalar);
        if (value == nullptr || printable(*value) != *value) {
          return report(node, key, "must be text of at most 160 bytes without control characters");
        }
        return put(&Reflection::SetString, &Reflection::AddString, *value);
      }
      default:
        return report(node, key, "cannot be given in a file");
    }
  }

  void read_word(const ConfigNode& node, const std::string& key, const FieldDescriptor& field,
                 Message& message) {
    const auto* const word = std::get_if<std::string>(&node.scalar);
    const EnumDescriptor& type = *field.enum_type();
    for (int i = 1; word != nullptr && i < type.value_count(); ++i) {
      if (enum_word(*type.value(i)) != *word) continue;
      return message.GetReflection()->SetEnumValue(&message, &field, type.value(i)->number());
    }
    report(node, key, "must be one of " + words_of(type));
  }

  std::string file_;
  ProblemList& problems_;
};

bool parse_number(std::string_view& text, double& value) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t'))
    text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t' || text.front() == '\r'))
    text.remove_prefix(1);
  return error == std::errc{} && std::isfinite(value);
}

}  // namespace

std::string word_of(v1::ExperimentState state) {
  const auto* const value =
      google::protobuf::GetEnumDescriptor<v1::ExperimentState>()->FindValueByNumber(state);
  return value == nullptr ? "unknown" : enum_word(*value);
}

ExperimentFile parse_experiment(std::string_view text, const std::string& name) {
  ProblemList problems;
  ExperimentFile result;
  if (const auto document = parse_document(text, name, problems)) {
    MessageReader(name, problems).read(*document, "", result.request);
    for (const ConfigNode& child : document->children) {
      if (child.key != "axis") continue;
      if (const auto* axis = std::get_if<std::string>(&child.scalar)) {
        result.axis = *axis;
      } else if (const auto* number = std::get_if<std::int64_t>(&child.scalar)) {
        result.axis = std::to_string(*number);
      } else {
        problems.add(name, child.line, "axis", "must be the name or the number of an axis");
      }
    }
  }
  if (result.request.mode() == v1::MODE_UNSPECIFIED) result.request.set_mode(v1::MODE_FREE);
  problems.throw_if_any();
  return result;
}

ExperimentFile load_experiment(const std::filesystem::path& file) {
  const FileText read = read_file(file, kMaxConfigBytes);
  if (!read.why_not.empty()) throw ConfigError({{file.string(), 0, {}, read.why_not}});
  ExperimentFile result = parse_experiment(read.text, file.string());
  for (v1::Shape& shape : *result.request.mutable_input()->mutable_shapes()) {
    if (!shape.has_table()) continue;
    const std::filesystem::path path = std::filesystem::absolute(file).parent_path() / shape.table().file();
    shape.mutable_table()->set_file(path.lexically_normal().string());
  }
  return result;
}

void read_table(const std::filesystem::path& file, const std::function<void(v1::UploadTable&)>& take) {
  const auto bad = [&](int line, const std::string& rule) {
    throw ConfigError({{file.string(), line, {}, rule}});
  };
  std::ifstream in(file, std::ios::binary);
  if (!in || std::filesystem::is_directory(file)) bad(0, "cannot be read");
  v1::UploadTable rows;
  std::array<char, kMaxCsvLine> buffer{};
  int line = 1;
  for (; in.getline(buffer.data(), buffer.size()); ++line) {
    std::string_view text(buffer.data());
    double time_s = 0.0;
    double value = 0.0;
    const bool good = parse_number(text, time_s) && text.starts_with(',') &&
                      (text.remove_prefix(1), parse_number(text, value)) && text.empty();
    if (!good && line == 1) continue;  // the names of the columns
    if (!good) bad(line, "must be a time in s, a comma and a value");
    rows.add_times_s(time_s);
    rows.add_values(value);
    if (rows.times_s_size() < kRowsPerUpload) continue;
    take(rows);
    rows.clear_times_s();
    rows.clear_values();
  }
  if (!in.eof()) bad(line, fmt::format("is longer than {} bytes", kMaxCsvLine));
  if (rows.times_s_size() > 0) take(rows);
}

}  // namespace drivebench::command
