#pragma once

#include <google/protobuf/descriptor.h>

#include <cctype>
#include <cstddef>
#include <string>

/// How the fields of RunExperiment stand in files.
namespace drivebench::command {

/// Fields that no file has: the client sets them.
inline bool is_hidden(const google::protobuf::FieldDescriptor& field) {
  const std::string& name = field.full_name();
  return name == "drivebench.v1.RunExperiment.owner" || name == "drivebench.v1.RunExperiment.request_key" ||
         name == "drivebench.v1.RunExperiment.axis" || name == "drivebench.v1.Shape.Table.id";
}

/// The word of an enumerator: CHANNEL_A of Channel is "a".
inline std::string enum_word(const google::protobuf::EnumValueDescriptor& value) {
  std::size_t prefix = value.type()->name().size() + 1;
  for (std::size_t i = 1; i < value.type()->name().size(); ++i)
    prefix +=
        static_cast<std::size_t>(std::isupper(static_cast<unsigned char>(value.type()->name()[i])) != 0);
  std::string word = value.name().substr(prefix);
  for (char& c : word)
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word;
}

}  // namespace drivebench::command
