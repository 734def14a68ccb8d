// The frames do not depend on how a Modbus stream is cut into reads, and are as long as their headers say; a
// request that the validator passes lies within the map.
#include <algorithm>
#include <string>
#include <vector>

#include "protocols/modbus/mbap.hpp"
#include "protocols/modbus/pdu.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace drivebench::fuzz {
namespace {

using Bytes = std::span<const std::uint8_t>;
using Frame = std::vector<std::uint8_t>;

const modbus::RegisterMap& map() {
  static constexpr auto kParameters = std::to_array<modbus::ParameterInfo>({
      {"real", "1", -1.0, 1.0, true, ""},
      {"other", "1", 0.0, 9.0, true, ""},
      {"fixed", "1", 0.0, 9.0, false, ""},
  });
  static const modbus::RegisterMap whole(kParameters, true);
  return whole;
}

struct Seen {
  std::vector<Frame> frames;
  std::string error;
  bool operator==(const Seen&) const = default;
};

Seen read_in_pieces(Bytes stream, std::size_t piece) {
  modbus::MbapReader reader;
  Seen seen;
  while (!stream.empty() && reader.error().empty()) {
    const std::span<std::uint8_t> room = reader.free_space();
    require(!room.empty(), "there is room when no frame waits");
    const std::size_t count = std::min({piece, room.size(), stream.size()});
    std::copy_n(stream.begin(), count, room.begin());
    reader.received(count);
    stream = stream.subspan(count);
    while (const auto adu = reader.next()) {
      require(adu->size() >= 8 && adu->size() <= modbus::kMaxAdu, "a frame has 8 to 260 bytes");
      require(adu->size() == 6u + static_cast<unsigned>((*adu)[4] << 8 | (*adu)[5]),
              "it is as long as it says");
      require((*adu)[2] == 0 && (*adu)[3] == 0, "its protocol is 0");
      seen.frames.emplace_back(adu->begin(), adu->end());
    }
  }
  seen.error = reader.error();
  return seen;
}

void check_range(const modbus::RegisterMap::Range& range) {
  require(!range.rows.empty() && range.first >= range.rows.front().address &&
              range.first + range.count <= range.rows.back().end(),
          "every register that is read or written belongs to a value");
}

void validate(const Frame& adu) {
  // A copy of exactly this size, so that the sanitizer sees one byte too many.
  const Frame pdu(adu.begin() + modbus::kMbapSize, adu.end());
  const modbus::PduCheck check = modbus::validate(pdu, map());
  if (check.action == modbus::PduCheck::Action::kRefuse) {
    const auto code = static_cast<unsigned>(check.exception);
    return require(code >= 1 && code <= 3, "the validator knows three exceptions");
  }
  if (check.action != modbus::PduCheck::Action::kExecute) return;
  const modbus::Request& request = check.request;
  if (request.read.count > 0) check_range(request.read);
  if (request.write.count == 0) return;
  check_range(request.write);
  require(map().may_write(request.write), "only writable registers are written");
  require(request.data.size() >= 2u * request.write.count, "there is a word for every register");
  if (request.function != modbus::Function::kMaskWriteRegister) {
    require(modbus::values_fit(request.write, modbus::words_from(request.data)), "values are in range");
  }
}

}  // namespace
}  // namespace drivebench::fuzz

/// One byte for the size of the pieces, then the stream.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench::fuzz;
  if (size < 1) return 0;
  const std::span<const std::uint8_t> stream(data + 1, size - 1);
  const Seen seen = read_in_pieces(stream, std::size_t{data[0]} + 1);
  require(seen == read_in_pieces(stream, size), "the cuts of a stream do not change its frames");
  for (const Frame& frame : seen.frames)
    validate(frame);
  return 0;
}
