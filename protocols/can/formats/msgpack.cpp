#include "protocols/can/formats/msgpack.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string_view>

#include "protocols/can/formats/text.hpp"

namespace drivebench::can {
namespace {

/// First bytes of values, from the MessagePack specification.
enum Head : std::uint8_t {
  kFixMap = 0x80,
  kFixArray = 0x90,
  kFixString = 0xa0,
  kNil = 0xc0,
  kFalse = 0xc2,
  kTrue = 0xc3,
  kBin8 = 0xc4,
  kBin32 = 0xc6,
  kExt8 = 0xc7,
  kExt32 = 0xc9,
  kFloat32 = 0xca,
  kFloat64 = 0xcb,
  kUint8 = 0xcc,
  kUint32 = 0xce,
  kUint64 = 0xcf,
  kInt8 = 0xd0,
  kInt64 = 0xd3,
  kFixExt1 = 0xd4,
  kFixExt16 = 0xd8,
  kString8 = 0xd9,
  kString32 = 0xdb,
  kArray16 = 0xdc,
  kArray32 = 0xdd,
  kMap16 = 0xde,
  kMap32 = 0xdf,
};

class Writer {
 public:
  explicit Writer(std::byte* out) : begin_(out), out_(out) {}

  void byte(std::uint64_t value) { *out_++ = static_cast<std::byte>(value); }
  void big_endian(std::uint64_t value, int bytes) {
    for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8)
      byte(value >> shift & 0xff);
  }
  void key(std::string_view name) {
    byte(kFixString | name.size());
    for (const char c : name)
      byte(static_cast<unsigned char>(c));
  }
  void flag(std::string_view name, bool value) {
    key(name);
    byte(value ? kTrue : kFalse);
  }
  /// Writes a number in the fewest bytes, as python-can does.
  void number(std::uint32_t value) {
    if (value < 0x80) return byte(value);
    const int bytes = value <= 0xff ? 1 : value <= 0xffff ? 2 : 4;
    byte(kUint8 + static_cast<unsigned>(std::countr_zero(static_cast<unsigned>(bytes))));
    big_endian(value, bytes);
  }
  std::size_t size() const { return static_cast<std::size_t>(out_ - begin_); }

 private:
  std::byte* begin_;
  std::byte* out_;
};

/// One value. `number` is set for numbers and flags, `bytes` for strings and binaries, `inside` for maps and
/// arrays: the number of values that follow inside of it.
struct Value {
  enum class Kind : std::uint8_t {
    kNothing,
    kNumber,
    kNegative,
    kFlag,
    kFloat,
    kString,
    kBinary,
    kMap,
    kOther
  };
  Kind kind = Kind::kOther;
  std::uint64_t number = 0;
  std::uint64_t inside = 0;
  std::span<const std::byte> bytes;

  std::string_view text() const { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }
};

class Reader {
 public:
  explicit Reader(std::span<const std::byte> in) : in_(in) {}

  bool at_end() const { return in_.empty(); }

  std::optional<Value> next() {
    const auto head = big_endian(1);
    if (!head) return std::nullopt;
    using enum Value::Kind;
    if (*head < kFixMap) return Value{kNumber, *head, 0, {}};
    if (*head < kFixArray) return Value{kMap, 0, 2 * (*head & 0xf), {}};
    if (*head < kFixString) return Value{kOther, 0, *head & 0xf, {}};
    if (*head < kNil) return with_bytes(kString, *head & 0x1f);
    if (*head == kNil) return Value{kNothing, 0, 0, {}};
    if (*head == kFalse || *head == kTrue) return Value{kFlag, *head & 1, 0, {}};
    if (*head >= kBin8 && *head <= kBin32) return with_length(kBinary, *head - kBin8, 0);
    if (*head >= kExt8 && *head <= kExt32) return with_length(kOther, *head - kExt8, 1);
    if (*head == kFloat32 || *head == kFloat64) return with_bytes(kFloat, *head == kFloat32 ? 4 : 8);
    if (*head >= kUint8 && *head <= kUint64) return unsigned_number(*head - kUint8);
    if (*head >= kInt8 && *head <= kInt64) return signed_number(*head - kInt8);
    if (*head >= kFixExt1 && *head <= kFixExt16)
      return with_bytes(kOther, 1 + (std::uint64_t{1} << (*head - kFixExt1)));
    if (*head >= kString8 && *head <= kString32) return with_length(kString, *head - kString8, 0);
    if (*head == kArray16 || *head == kArray32) return with_count(kOther, *head - kArray16, 1);
    if (*head == kMap16 || *head == kMap32) return with_count(kMap, *head - kMap16, 2);
    if (*head >= 0xe0) return Value{kNegative, 0, 0, {}};
    return std::nullopt;  // 0xc1 is never used
  }

  /// Skips all values inside of this one, at any depth.
  bool skip_inside(const Value& value) {
    for (std::uint64_t left = value.inside; left > 0; --left) {
      const auto inner = next();
      if (!inner) return false;
      left += inner->inside;
    }
    return true;
  }

 private:
  std::optional<std::uint64_t> big_endian(std::size_t bytes) {
    if (in_.size() < bytes) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i)
      value = value << 8 | std::to_integer<std::uint64_t>(in_[i]);
    in_ = in_.subspan(bytes);
    return value;
  }
  std::optional<Value> with_bytes(Value::Kind kind, std::uint64_t count) {
    if (in_.size() < count) return std::nullopt;
    const Value value{kind, 0, 0, in_.first(static_cast<std::size_t>(count))};
    in_ = in_.subspan(static_cast<std::size_t>(count));
    return value;
  }
  std::optional<Value> with_length(Value::Kind kind, std::uint64_t log2_width, std::uint64_t more) {
    const auto length = big_endian(std::size_t{1} << log2_width);
    return length ? with_bytes(kind, *length + more) : std::nullopt;
  }
  std::optional<Value> with_count(Value::Kind kind, std::uint64_t wide, std::uint64_t values_each) {
    const auto count = big_endian(wide != 0 ? 4 : 2);
    if (!count) return std::nullopt;
    return Value{kind, 0, *count * values_each, {}};
  }
  std::optional<Value> unsigned_number(std::uint64_t log2_width) {
    const auto number = big_endian(std::size_t{1} << log2_width);
    if (!number) return std::nullopt;
    return Value{Value::Kind::kNumber, *number, 0, {}};
  }
  std::optional<Value> signed_number(std::uint64_t log2_width) {
    const auto number = big_endian(std::size_t{1} << log2_width);
    if (!number) return std::nullopt;
    const bool negative = (*number >> ((std::size_t{8} << log2_width) - 1)) != 0;
    return Value{negative ? Value::Kind::kNegative : Value::Kind::kNumber, *number, 0, {}};
  }

  std::span<const std::byte> in_;
};

/// The content of the map, unchecked.
struct Fields {
  Frame frame{.extended = true};
  std::optional<std::uint32_t> id;
  std::optional<std::uint64_t> size;
  std::size_t data_size = 0;
};

bool take_flag(const Value& value, bool& flag) {
  if (value.kind != Value::Kind::kFlag && value.kind != Value::Kind::kNumber) return false;
  flag = value.number != 0;
  return value.number <= 1;
}

bool take_data(const Value& value, Fields& fields) {
  if (value.kind != Value::Kind::kNothing && value.kind != Value::Kind::kBinary) return false;
  if (value.bytes.size() > fields.frame.data.size()) return false;
  fields.frame.data.fill(0);  // a key may come twice; the last one counts
  std::ranges::transform(value.bytes, fields.frame.data.begin(),
                         [](std::byte byte) { return std::to_integer<std::uint8_t>(byte); });
  fields.data_size = value.bytes.size();
  return true;
}

bool take(std::string_view key, const Value& value, Fields& fields) {
  Frame& frame = fields.frame;
  if (key == "arbitration_id") {
    if (value.kind != Value::Kind::kNumber || value.number > kMaxExtendedId) return false;
    fields.id = static_cast<std::uint32_t>(value.number);
    return true;
  }
  if (key == "dlc") {
    if (value.kind == Value::Kind::kNothing) return true;
    fields.size = value.number;
    return value.kind == Value::Kind::kNumber && value.number <= frame.data.size();
  }
  if (key == "data") return take_data(value, fields);
  if (key == "is_extended_id") return take_flag(value, frame.extended);
  if (key == "is_remote_frame") return take_flag(value, frame.remote);
  if (key == "is_error_frame") return take_flag(value, frame.error);
  if (key == "is_fd") return take_flag(value, frame.fd);
  if (key == "bitrate_switch") return take_flag(value, frame.bit_rate_switch);
  if (key == "error_state_indicator") return take_flag(value, frame.error_state);
  return true;
}

}  // namespace

std::size_t encode_msgpack(const Frame& frame, double timestamp_s, std::span<std::byte> out) noexcept {
  if (out.size() < kMaxMsgpackFrame || frame.size > frame.data.size()) return 0;
  Writer writer(out.data());
  writer.byte(kFixMap | 11);
  writer.key("timestamp");
  writer.byte(kFloat64);
  writer.big_endian(std::bit_cast<std::uint64_t>(timestamp_s), 8);
  writer.key("arbitration_id");
  writer.number(frame.id);
  writer.flag("is_extended_id", frame.extended);
  writer.flag("is_remote_frame", frame.remote);
  writer.flag("is_error_frame", frame.error);
  writer.key("channel");
  writer.byte(kNil);
  writer.key("dlc");
  writer.number(frame.size);
  writer.key("data");
  const std::size_t data_size = frame.remote ? 0 : frame.size;
  writer.byte(kBin8);
  writer.byte(data_size);
  for (std::size_t i = 0; i < data_size; ++i)
    writer.byte(frame.data[i]);
  writer.flag("is_fd", frame.fd);
  writer.flag("bitrate_switch", frame.bit_rate_switch);
  writer.flag("error_state_indicator", frame.error_state);
  return writer.size();
}

std::optional<Frame> decode_msgpack(std::span<const std::byte> in) noexcept {
  Reader reader(in);
  const auto map = reader.next();
  if (!map || map->kind != Value::Kind::kMap) return std::nullopt;
  Fields fields;
  for (std::uint64_t left = map->inside / 2; left > 0; --left) {
    const auto key = reader.next();
    if (!key || key->kind != Value::Kind::kString) return std::nullopt;
    const auto value = reader.next();
    if (!value || !take(key->text(), *value, fields) || !reader.skip_inside(*value)) return std::nullopt;
  }
  if (!reader.at_end() || !fields.id) return std::nullopt;
  Frame& frame = fields.frame;
  frame.id = *fields.id;
  frame.size = static_cast<std::uint8_t>(fields.size.value_or(fields.data_size));
  if (fields.data_size != (frame.remote ? 0 : frame.size) || !is_possible(frame)) return std::nullopt;
  return frame;
}

}  // namespace drivebench::can
