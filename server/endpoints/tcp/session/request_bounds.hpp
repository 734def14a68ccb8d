#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "bench.pb.h"

namespace drivebench {

/// The most fields of a frame, at all depths together; an unpacked element is a field. The longest request is
/// a table of 7,281 unpacked numbers.
inline constexpr std::size_t kMaxRequestFields = 8192;
/// The most fields among them that this server does not know: those of newer clients.
inline constexpr std::size_t kMaxUnknownFields = 64;
/// The most members of a oneof that others take the place of, which no client writes: each is made and thrown
/// away, so that a frame that goes to and fro costs more allocations than it has fields.
inline constexpr std::size_t kMaxReplacedFields = 8;
/// The deepest nesting of messages and groups.
inline constexpr int kMaxRequestNesting = 16;

/// The result of reading a frame.
struct FrameReading {
  enum class Outcome {
    kRequest,
    kNoEnvelope,  ///< the session ends: no client of this protocol sends such bytes
    kRefused,     ///< no request, or a larger one than allowed; nothing was parsed
  };
  Outcome outcome = Outcome::kRequest;
  std::uint64_t id = 0;  ///< of the envelope; 0 if the frame is none
  v1::Envelope::KindCase kind = v1::Envelope::KIND_NOT_SET;
  v1::RefusalCode code = v1::REFUSAL_MALFORMED;
  std::string sentence{};
  std::string field{};
};

/// Parses a frame into an empty message, after counting its fields: two bytes on the wire can become a
/// hundred in memory, so a kind that is no request, and more fields or elements than any request needs, are
/// refused before anything is made of them.
FrameReading read_request(std::span<const std::byte> frame, v1::Envelope& request);

/// The most elements of a repeated field in a whole frame; 0 for a field of no request.
std::size_t most_elements(const google::protobuf::FieldDescriptor& repeated);

/// Whether clients send messages of this kind.
bool is_request(v1::Envelope::KindCase kind) noexcept;

}  // namespace drivebench
