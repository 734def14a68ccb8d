// Frames with any contents: they are classified without a read outside them, and a frame that is taken for a
// message encodes to itself.
#include <algorithm>
#include <cmath>

#include "protocols/can/codec.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/protocols/can/can_edge.hpp"

namespace {
using namespace drivebench;
using namespace drivebench::can;

/// Byte 0 has the flags of the profile and the frame, 1 to 4 the identifier, 5 the size; then the data.
constexpr std::size_t kHead = 6;

Profile profile_of(unsigned flags) {
  Profile profile;
  profile.fd = (flags & 1) != 0;
  profile.choose_ids((flags & 128) != 0 ? IdSet::kCanopen : IdSet::kFree, (flags & 2) != 0);
  profile.wide = (flags & 64) != 0;
  return profile;
}

Frame frame_of(std::span<const std::uint8_t> bytes) {
  Frame frame;
  for (unsigned i = 0; i < 4; ++i)
    frame.id |= std::uint32_t{bytes[1 + i]} << 8 * i;
  frame.fd = frame.bit_rate_switch = (bytes[0] & 4) != 0;
  frame.extended = (bytes[0] & 8) != 0;
  frame.remote = (bytes[0] & 16) != 0;
  frame.error = (bytes[0] & 32) != 0;
  frame.size = bytes[5];
  const auto data = bytes.subspan(kHead).first(std::min(bytes.size() - kHead, frame.data.size()));
  std::ranges::copy(data, frame.data.begin());
  return frame;
}

bool is_number(const MessageRow& row, const Values& values) {
  for (std::size_t i = 0; i < row.fields.size(); ++i) {
    if (std::isnan(values[i])) return false;
  }
  return true;
}

void require_message(const MessageRow& row, const Profile& profile, const Frame& made) {
  const Match found = match(profile, made);
  fuzz::require(found.ok() && found.row == &row, "an encoded message is recognised");
}

void check_message(const MessageRow& row, std::uint32_t node, const Profile& profile, const Frame& frame) {
  const Values values = decode(row, profile, frame);
  Frame again = encode(row, profile, node, values);
  again.fd = frame.fd;  // the FD profile takes classic frames, too
  again.bit_rate_switch = frame.bit_rate_switch;
  if (row.message == Message::kEdges) {
    for (std::size_t i = 0; i < kEdgesPerFrame; ++i)
      put_edge(again, i, edge_at(frame, i));
  }
  // Bytes beyond the size have no meaning, and a NaN may lose its payload.
  Frame expected = frame;
  std::fill(expected.data.begin() + frame.size, expected.data.end(), std::uint8_t{0});
  fuzz::require(again == expected || !is_number(row, values), "a message encodes to the frame it came from");

  Sample sample;
  update_sample(row, values, sample);
  for (std::size_t page = 0; page < (is_paged(row) ? kPages : 1); ++page) {
    const Frame sampled = encode_sample(row, profile, node, sample, static_cast<Page>(page));
    require_message(row, profile, sampled);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < kHead) return 0;
  const std::span bytes(data, size);
  const Profile profile = profile_of(bytes[0]);
  const Frame frame = frame_of(bytes);
  const Match found = match(profile, frame);
  fuzz::require(!name_of(found.problem).empty(), "every problem has a name");
  fuzz::require(!found.ok() || (found.row != nullptr && found.row->size == frame.size), "its size is right");
  if (found.ok()) check_message(*found.row, found.node, profile, frame);
  if (size < kHead + sizeof(double)) return 0;

  // Any double in any field makes a frame that is taken.
  double value{};
  std::copy_n(data + kHead, sizeof value, reinterpret_cast<std::uint8_t*>(&value));
  for (const MessageRow& row : kMessages) {
    if (!is_on(row, profile)) continue;
    Values values;
    values.fill(value);
    const Frame made = encode(row, profile, 1, values);
    require_message(row, profile, made);
    const Frame again = encode(row, profile, 1, decode(row, profile, made));
    fuzz::require(again == made || std::isnan(value), "a number is rounded once");
  }
  return 0;
}
