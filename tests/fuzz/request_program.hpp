#pragma once

#include <bench.pb.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "protocols/framing.hpp"
#include "server/endpoints/tcp/session/request_bounds.hpp"

/// Frames by small programs, so that a search over a few bytes reaches every message of 64 KiB that repeats
/// something.
namespace drivebench::fuzz {

/// Bytes of a program for one part of the frame.
inline constexpr std::size_t kPartBytes = 8;

namespace wire {

using google::protobuf::FieldDescriptor;

inline constexpr std::uint32_t kUnknownNumber = 2000;

inline std::string varint(std::uint64_t number) {
  std::string out;
  for (; number > 0x7F; number >>= 7)
    out += static_cast<char>(number | 0x80);
  return out + static_cast<char>(number);
}

inline std::string tagged(std::uint32_t number, std::uint32_t type, const std::string& content) {
  const std::string tag = varint(number << 3 | type);
  return type == 2 ? tag + varint(content.size()) + content : tag + content;
}

inline constexpr std::size_t kMostRepeated = kMaxRequestFrame - 64;  // with room for the tags around it

inline std::string repeated(const std::string& part, std::size_t count) {
  std::string out;
  for (std::size_t n = 0; !part.empty() && n < std::min(count, kMostRepeated / part.size()); ++n)
    out += part;
  return out;
}

/// A field without submessages: in the form that the descriptor asks for, or in another one, which makes it
/// an unknown one.
inline std::string leaf(const FieldDescriptor* field, unsigned form, std::size_t size) {
  const std::uint32_t number =
      field == nullptr ? kUnknownNumber : static_cast<std::uint32_t>(field->number());
  switch (form) {
    case 0:
      return tagged(number, 0, varint(1));
    case 1:
      return tagged(number, 1, std::string(8, '\1'));
    case 2:
      return tagged(number, 5, std::string(4, '\1'));
    case 3:
      return tagged(number, 3, tagged(number, 4, ""));
    default:
      return tagged(number, 2, std::string(size, '\1'));
  }
}

}  // namespace wire

/// One part of a frame: a field somewhere in the tree of messages, and where on the way there it is repeated.
inline std::string part_of(std::span<const std::uint8_t, kPartBytes> code) {
  using wire::FieldDescriptor;
  constexpr auto kCounts = std::to_array<std::size_t>({1, 1, 1, 2, 16, 256, 8192, 65536});
  constexpr auto kSizes =
      std::to_array<std::size_t>({0, 1, 8, 15, 16, 23, 24, 100, 250, 1000, 4096, 8192, 32768});
  std::vector<const FieldDescriptor*> path;  // the last one may be null: unknown
  const google::protobuf::Descriptor* type = v1::Envelope::descriptor();
  for (std::size_t depth = 0; depth < 4 && type != nullptr; ++depth) {
    const auto choice = static_cast<int>(code[depth] % static_cast<unsigned>(type->field_count() + 2));
    if (choice > type->field_count() && !path.empty()) break;  // the message itself
    path.push_back(choice < type->field_count() ? type->field(choice) : nullptr);
    type = path.back() == nullptr ? nullptr : path.back()->message_type();
  }
  const std::size_t repeat_at = code[4] % path.size();
  // Half of the counts are those at which a bound lies.
  const FieldDescriptor* const repeats = path[repeat_at];
  const bool has_bound = repeats != nullptr && repeats->is_repeated() && code[5] >= 128;
  const std::size_t count =
      has_bound ? most_elements(*repeats) + (code[5] % 4 == 0 ? 1 : 0) : kCounts[code[5] % kCounts.size()];
  const std::size_t size = kSizes[code[6] % kSizes.size()];
  std::string content;
  for (std::size_t level = path.size(); level-- > 0;) {
    const FieldDescriptor* const field = path[level];
    if (level + 1 == path.size() && (field == nullptr || field->message_type() == nullptr)) {
      content = wire::leaf(field, code[7] % 5, size);
    } else {
      content = wire::tagged(static_cast<std::uint32_t>(field->number()), 2, content);
    }
    if (level == repeat_at) content = wire::repeated(content, count);
  }
  return content;
}

/// The frame of a program, as long as it may be. A part with a high last byte also repeats all up to here.
inline std::string frame_of(std::span<const std::uint8_t> program) {
  std::string frame;
  for (; program.size() >= kPartBytes; program = program.subspan(kPartBytes)) {
    const std::string part = part_of(program.first<kPartBytes>());
    if (frame.size() + part.size() <= kMaxRequestFrame) frame += part;
    const unsigned again = program[kPartBytes - 1];
    if (again >= 0xC0) frame = wire::repeated(frame, kMaxRequestFields / (1 + again % 32));
  }
  return frame;
}

/// Draws programs, then climbs from the best of each kind of message by changing them and joining their
/// parts. Gives the program of the frame with the highest score; for the same scores the same one.
template <class Score>
std::vector<std::uint8_t> worst_program(Score score, std::uint64_t seed) {
  constexpr std::size_t kDrawn = 1000;
  constexpr std::size_t kKept = 24;
  constexpr std::size_t kSteps = 800;
  constexpr std::size_t kMaxParts = 16;
  struct Program {
    double points = 0.0;
    std::vector<std::uint8_t> code{};
  };
  std::mt19937_64 random(seed);
  const auto below = [&random](std::size_t limit) { return static_cast<std::size_t>(random() % limit); };
  const auto byte = [&random] { return static_cast<std::uint8_t>(random()); };
  const auto judged = [&score](std::vector<std::uint8_t> code) {
    const auto points = static_cast<double>(score(frame_of(code)));
    return Program{.points = points, .code = std::move(code)};
  };

  std::vector<Program> best;
  for (std::size_t drawn = 0; drawn < kDrawn; ++drawn) {
    std::vector<std::uint8_t> code(kPartBytes * (1 + below(3)));
    std::ranges::generate(code, byte);
    best.push_back(judged(std::move(code)));
  }
  std::ranges::stable_sort(best, std::greater<>{}, &Program::points);
  best.resize(kKept);
  for (std::size_t step = 0; step < kSteps; ++step) {
    Program& program = best[below(kKept)];
    std::vector<std::uint8_t> code = program.code;
    const std::vector<std::uint8_t>& other = best[below(kKept)].code;
    const std::size_t parts = code.size() / kPartBytes;
    switch (below(4)) {
      case 0:
        if (parts + other.size() / kPartBytes <= kMaxParts)
          code.insert(code.end(), other.begin(), other.end());
        break;
      case 1:
        if (parts > 1) {
          const auto part = code.begin() + static_cast<std::ptrdiff_t>(kPartBytes * below(parts));
          code.erase(part, part + static_cast<std::ptrdiff_t>(kPartBytes));
        }
        break;
      default:
        for (std::size_t changes = 1 + below(2); changes > 0; --changes) {
          std::uint8_t& changed = code[below(code.size())];
          changed = below(2) == 0 ? byte() : static_cast<std::uint8_t>(changed + (below(2) == 0 ? 1 : 255));
        }
    }
    if (Program next = judged(std::move(code)); next.points >= program.points) program = std::move(next);
  }
  return std::ranges::max_element(best, {}, &Program::points)->code;
}

}  // namespace drivebench::fuzz
