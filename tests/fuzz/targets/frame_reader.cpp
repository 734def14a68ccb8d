// The frames do not depend on how a stream is cut into reads, and none is longer than the cap.
#include <algorithm>
#include <string>
#include <vector>

#include "protocols/framing.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace drivebench::fuzz {
namespace {

constexpr std::size_t kCapacity = 256;

struct Seen {
  std::vector<std::vector<std::byte>> frames;
  std::string error;
  bool operator==(const Seen&) const = default;
};

/// Takes all whole frames out of the reader.
void take_frames(FrameReader& reader, std::size_t cap, Seen& seen) {
  while (const auto frame = reader.next()) {
    require(!frame->empty() && frame->size() <= cap, "a frame has 1 byte to the cap");
    seen.frames.emplace_back(frame->begin(), frame->end());
  }
}

/// Reads the stream in pieces whose sizes come from `cuts`, round and round; 0 stands for as much as fits.
Seen read_in_pieces(std::span<const std::byte> stream, std::size_t cap, std::span<const std::byte> cuts) {
  FrameReader reader(kCapacity);
  reader.set_max_payload(cap);
  Seen seen;
  for (std::size_t i = 0; !stream.empty() && reader.error().empty(); ++i) {
    const std::span<std::byte> room = reader.free_space();
    require(!room.empty(), "there is room when no frame waits");
    const std::size_t wish = cuts.empty() ? 0 : std::to_integer<std::size_t>(cuts[i % cuts.size()]);
    const std::size_t count = std::min({wish == 0 ? room.size() : wish, room.size(), stream.size()});
    std::copy_n(stream.begin(), count, room.begin());
    reader.received(count);
    stream = stream.subspan(count);
    take_frames(reader, cap, seen);
  }
  seen.error = reader.error();
  return seen;
}

}  // namespace
}  // namespace drivebench::fuzz

/// One byte for the cap, one for the number of cuts, the cuts, the stream.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench::fuzz;
  if (size < 2) return 0;
  const auto bytes = as_bytes_of(data, size);
  const std::size_t cap = std::size_t{data[0]} + 1;
  const std::size_t cut_count = std::min<std::size_t>(data[1], size - 2);
  const auto cuts = bytes.subspan(2, cut_count);
  const auto stream = bytes.subspan(2 + cut_count);
  require(read_in_pieces(stream, cap, cuts) == read_in_pieces(stream, cap, {}),
          "the cuts of a stream do not change its frames");
  return 0;
}
