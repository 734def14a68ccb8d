// The decoder written by hand: it reads nothing outside its bytes, agrees with protobuf's, and its samples
// encode back.
#include "protocols/sample_codec.hpp"

#include <bench.pb.h>

#include <array>
#include <bit>
#include <string>

#include "tests/fuzz/fuzz.hpp"

namespace {

using Words = std::array<std::uint64_t, drivebench::kSampleWords>;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  const std::optional<Sample> sample = decode_sample(fuzz::as_bytes_of(data, size));
  if (!sample) return 0;

  std::array<std::byte, kMaxSampleBytes> bytes{};
  const std::size_t used = encode_sample(*sample, kAllSignals, bytes.data());
  fuzz::require(used <= bytes.size(), "a sample fits its bound");
  const std::optional<Sample> again = decode_sample(std::span(bytes).first(used));
  fuzz::require(again && std::bit_cast<Words>(*again) == std::bit_cast<Words>(*sample),
                "a decoded sample encodes and decodes to the same bits");

  v1::Sample theirs;
  if (!theirs.ParseFromArray(data, static_cast<int>(size))) return 0;  // it refuses tags of more than 5 bytes
  const std::string text = theirs.SerializeAsString();
  const std::optional<Sample> by_protobuf = decode_sample(std::as_bytes(std::span(text)));
  fuzz::require(by_protobuf && std::bit_cast<Words>(*by_protobuf) == std::bit_cast<Words>(*sample),
                "protobuf reads the same sample");
  return 0;
}
