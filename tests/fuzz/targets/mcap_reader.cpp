// Everything that the reader hands out lies inside the file; it ends with a whole file or a sentence.
#include <functional>
#include <string_view>

#include "protocols/mcap/mcap.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace drivebench::fuzz {
namespace {

class Bounds {
 public:
  explicit Bounds(std::span<const std::byte> file) : file_(file) {}

  void check(std::span<const std::byte> part) const {
    if (part.empty()) return;
    // std::less orders pointers that do not belong together as well.
    const std::less<const std::byte*> before;
    const std::byte* const begin = file_.data();
    require(!before(part.data(), begin) && !before(begin + file_.size(), part.data() + part.size()),
            "every read lies in the file");
  }
  void check(std::string_view part) const { check(std::as_bytes(std::span(part))); }
  void check(const McapMapView& map) const {
    for (const auto& [key, value] : map) {
      check(key);
      check(value);
    }
  }

 private:
  std::span<const std::byte> file_;
};

void check_contents(const McapReader& reader, const Bounds& bounds) {
  bounds.check(reader.profile());
  bounds.check(reader.library());
  for (const auto& [id, schema] : reader.schemas()) {
    require(id == schema.id && id != 0, "a schema stands under its id");
    bounds.check(schema.name);
    bounds.check(schema.encoding);
    bounds.check(schema.data);
  }
  for (const auto& [id, channel] : reader.channels()) {
    require(id == channel.id, "a channel stands under its id");
    require(channel.schema_id == 0 || reader.schemas().contains(channel.schema_id), "its schema is known");
    bounds.check(channel.topic);
    bounds.check(channel.message_encoding);
    bounds.check(channel.metadata);
  }
  for (const McapAttachment& attachment : reader.attachments()) {
    bounds.check(attachment.name);
    bounds.check(attachment.media_type);
    bounds.check(attachment.data);
  }
  for (const McapMetadata& metadata : reader.metadata()) {
    bounds.check(metadata.name);
    bounds.check(metadata.entries);
  }
}

}  // namespace
}  // namespace drivebench::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  const auto file = fuzz::as_bytes_of(data, size);
  const fuzz::Bounds bounds(file);
  McapReader reader(file);
  std::uint64_t messages = 0;
  for (McapMessage message; reader.next(message); ++messages) {
    fuzz::require(reader.channels().contains(message.header.channel), "a message has a known channel");
    bounds.check(message.payload);
  }
  fuzz::check_contents(reader, bounds);
  fuzz::require(messages == reader.message_count(), "the messages are counted");
  if (reader.problem()) {
    fuzz::require(reader.problem()->offset <= size, "a problem has a place in the file");
    fuzz::require(!reader.problem()->what.empty(), "a problem is a sentence");
  }
  McapMessage nothing;
  fuzz::require(!reader.next(nothing), "the end stays the end");
  return 0;
}
