#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/unknown_field_set.h>

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/endpoints/tcp/session/request_bounds.hpp"
#include "tests/fuzz/counted_memory.hpp"

/// The promises that every message of read_request() keeps, made of a frame of 64 KiB.
namespace drivebench::fuzz {

inline constexpr std::size_t kMostParsedBytes = std::size_t{256} * 1024;
inline constexpr std::size_t kMostAllocations = kMaxRequestFields;

inline std::size_t unknown_fields_of(const google::protobuf::UnknownFieldSet& fields) {
  std::size_t count = static_cast<std::size_t>(fields.field_count());
  for (int i = 0; i < fields.field_count(); ++i) {
    if (fields.field(i).type() == google::protobuf::UnknownField::TYPE_GROUP) {
      count += unknown_fields_of(fields.field(i).group());
    }
  }
  return count;
}

/// Elements by their field, and unknown fields, of a message and all below it.
struct Elements {
  std::vector<std::pair<const google::protobuf::FieldDescriptor*, std::size_t>> repeated;
  std::size_t unknown = 0;

  void add(const google::protobuf::Message& message) {
    const google::protobuf::Reflection& reflection = *message.GetReflection();
    unknown += unknown_fields_of(reflection.GetUnknownFields(message));
    std::vector<const google::protobuf::FieldDescriptor*> fields;
    reflection.ListFields(message, &fields);
    for (const auto* field : fields) {
      const int size = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
      if (field->is_repeated()) repeated.emplace_back(field, static_cast<std::size_t>(size));
      for (int i = 0; field->message_type() != nullptr && i < size; ++i) {
        add(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                 : reflection.GetMessage(message, field));
      }
    }
  }
};

/// The promise that a message breaks; empty: none.
inline std::string broken_promise(const v1::Envelope& request) {
  Elements elements;
  elements.add(request);
  if (!is_request(request.kind_case())) return "it is a request";
  if (elements.unknown > kMaxUnknownFields) return "it has few fields that the server does not know";
  for (const auto& [field, count] : elements.repeated) {
    std::size_t all = 0;
    for (const auto& [other, more] : elements.repeated)
      all += other == field ? more : 0;
    if (all > most_elements(*field)) return field->full_name() + " has as many elements as it may have";
  }
  return {};
}

/// The memory that a frame costs the server, and the promise that it breaks.
struct FrameCost {
  Taken taken{};
  std::string broken{};
};

/// The first request of a program builds the descriptors of all messages, whatever it asks.
inline bool know_the_messages() {
  v1::Envelope request;
  request.mutable_lease();
  const std::string frame = request.SerializeAsString();
  v1::Envelope read;
  return read_request(std::as_bytes(std::span(frame)), read).outcome == FrameReading::Outcome::kRequest;
}

inline FrameCost cost_of(const std::string& frame) {
  static const bool kKnown = know_the_messages();
  if (!kKnown) return {.broken = "a small request is one"};
  FrameCost cost;
  v1::Envelope request;
  FrameReading reading;
  cost.taken = taken_by([&] { reading = read_request(std::as_bytes(std::span(frame)), request); });
  if (reading.outcome == FrameReading::Outcome::kRequest) cost.broken = broken_promise(request);
  if (cost.taken.peak_bytes > kMostParsedBytes) cost.broken = "it takes little memory";
  if (cost.taken.calls > kMostAllocations) cost.broken = "it takes few allocations";
  return cost;
}

}  // namespace drivebench::fuzz
