#include "protocols/sample_codec.hpp"

#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "bench.pb.h"
#include "protocols/framing.hpp"
#include "protocols/wire.hpp"

namespace drivebench::sample_codec_test {
namespace {

using google::protobuf::FieldDescriptor;

constexpr std::uint64_t kNanWithPayload = 0xfff8'dead'beef'0123u;

std::string encoded(const Sample& sample, SignalMask mask = kAllSignals) {
  std::array<std::byte, kMaxSampleBytes> bytes;
  const std::size_t size = encode_sample(sample, mask, bytes.data());
  return {reinterpret_cast<const char*>(bytes.data()), size};
}

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

/// The word of a signal, whatever its type.
std::uint64_t word(const Sample& sample, const Signal& signal) {
  switch (signal.type) {
    case SignalType::kUnsigned:
      return sample.*signal.as_unsigned;
    case SignalType::kSigned:
      return static_cast<std::uint64_t>(sample.*signal.as_signed);
    case SignalType::kReal:
      break;
  }
  return std::bit_cast<std::uint64_t>(sample.*signal.as_real);
}

void set_word(Sample& sample, const Signal& signal, std::uint64_t value) {
  switch (signal.type) {
    case SignalType::kUnsigned:
      sample.*signal.as_unsigned = value;
      return;
    case SignalType::kSigned:
      sample.*signal.as_signed = static_cast<std::int64_t>(value);
      return;
    case SignalType::kReal:
      sample.*signal.as_real = std::bit_cast<double>(value);
      return;
  }
}

/// The same word, read from the class that protobuf generated.
std::uint64_t word(const v1::Sample& message, const Signal& signal) {
  const FieldDescriptor* field = v1::Sample::descriptor()->FindFieldByName(std::string(signal.name));
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  switch (field->type()) {
    case FieldDescriptor::TYPE_UINT64:
      return reflection.GetUInt64(message, field);
    case FieldDescriptor::TYPE_SINT64:
      return static_cast<std::uint64_t>(reflection.GetInt64(message, field));
    default:
      return std::bit_cast<std::uint64_t>(reflection.GetDouble(message, field));
  }
}

void set_word(v1::Sample& message, const Signal& signal, std::uint64_t value) {
  const FieldDescriptor* field = v1::Sample::descriptor()->FindFieldByName(std::string(signal.name));
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  switch (field->type()) {
    case FieldDescriptor::TYPE_UINT64:
      return reflection.SetUInt64(&message, field, value);
    case FieldDescriptor::TYPE_SINT64:
      return reflection.SetInt64(&message, field, static_cast<std::int64_t>(value));
    default:
      return reflection.SetDouble(&message, field, std::bit_cast<double>(value));
  }
}

Sample nothing_but_zeros() {
  Sample sample;
  for (const Signal& signal : kSignals)
    set_word(sample, signal, 0);
  return sample;
}

constexpr auto kTrickyWords = std::to_array<std::uint64_t>(
    {0, 1, 0x7f, 0x80, 0x3fff, 0x4000, 0xffff'ffff, 1ull << 53, 0x7fff'ffff'ffff'ffff, 0x8000'0000'0000'0000,
     0xffff'ffff'ffff'ffff, 0x3ff0'0000'0000'0000, 0x7ff0'0000'0000'0000, 0x7ff0'0000'0000'0001,
     kNanWithPayload});

// Catches: a wrong field number, type, zigzag or byte order in our encoder, for each signal alone; a negative
// zero taken for a default; a NaN that loses its payload.
TEST(SampleCodec, EverySignalAloneReadsBackThroughProtobuf) {
  for (const Signal& signal : kSignals) {
    for (const std::uint64_t value : kTrickyWords) {
      Sample sample = nothing_but_zeros();
      set_word(sample, signal, value);
      v1::Sample message;
      ASSERT_TRUE(message.ParseFromString(encoded(sample))) << signal.name;
      for (const Signal& other : kSignals) {
        EXPECT_EQ(word(message, other), word(sample, other))
            << signal.name << " " << value << " " << other.name;
      }
      // The bytes are what protobuf itself writes.
      EXPECT_EQ(encoded(sample), message.SerializeAsString()) << signal.name;
    }
  }
}

// Catches: a field that our decoder reads differently from protobuf, and a default of Sample (-1) that stands
// where proto3 left a zero out.
TEST(SampleCodec, RandomSamplesOfProtobufReadBackThroughOurDecoder) {
  std::mt19937_64 random(42);
  for (int round = 0; round < 5000; ++round) {
    v1::Sample message;
    for (const Signal& signal : kSignals) {
      const std::uint64_t value = random() % 4 == 0 ? kTrickyWords[random() % kTrickyWords.size()] : random();
      set_word(message, signal, value);
    }
    const std::optional<Sample> sample = decode_sample(bytes_of(message.SerializeAsString()));
    ASSERT_TRUE(sample);
    for (const Signal& signal : kSignals)
      ASSERT_EQ(word(*sample, signal), word(message, signal)) << signal.name;
    EXPECT_EQ(encoded(*sample), message.SerializeAsString());
  }
}

// Catches: a mask that is off by one row, or ignored.
TEST(SampleCodec, MaskedSignalsAreLeftOut) {
  std::mt19937_64 random(7);
  Sample sample;
  for (const Signal& signal : kSignals)
    set_word(sample, signal, 3);
  for (int round = 0; round < 500; ++round) {
    const SignalMask mask = (SignalMask{random()} << 64 | random()) & kAllSignals;
    v1::Sample message;
    ASSERT_TRUE(message.ParseFromString(encoded(sample, mask)));
    for (std::size_t row = 0; row < kSignals.size(); ++row) {
      EXPECT_EQ(word(message, kSignals[row]), (mask >> row & 1) != 0 ? 3u : 0u) << kSignals[row].name;
    }
  }
  EXPECT_EQ(encoded(sample, 0), "");
}

// Catches: a sample that is longer than the room that callers leave for it.
TEST(SampleCodec, TheLargestSampleFitsTheBound) {
  Sample sample;
  for (const Signal& signal : kSignals)
    set_word(sample, signal, signal.type == SignalType::kSigned ? 1ull << 63 : ~0ull);
  EXPECT_LE(encoded(sample).size(), kMaxSampleBytes);
}

// Catches: a decoder that reads past the end, or takes a cut or foreign message for a sample.
TEST(SampleCodec, BytesThatAreNoSampleAreRefused) {
  Sample sample;
  for (const Signal& signal : kSignals)
    set_word(sample, signal, 0x1234'5678'9abc'def1u);
  const std::string whole = encoded(sample);
  std::size_t refused = 0;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::string cut = whole.substr(0, size);
    v1::Sample message;
    EXPECT_EQ(decode_sample(bytes_of(cut)).has_value(), message.ParseFromString(cut)) << size;
    if (!decode_sample(bytes_of(cut))) ++refused;
  }
  EXPECT_GT(refused, whole.size() / 2);
  using namespace std::string_literals;
  for (const std::string& bad :
       {"\x00\x00"s,                                          // field 0
        "\xe0\x01\x01"s,                                      // field 28
        "\x09\x00\x00\x00\x00\x00\x00\x00\x00"s,              // tick as fixed64
        "\x80\x01\x00"s,                                      // i_a_a as varint
        "\x08\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"s,  // eleven bytes of varint
        "\x0a\x01\x00"s}) {                                   // tick as bytes
    EXPECT_EQ(decode_sample(bytes_of(bad)), std::nullopt) << bad.size();
  }
}

// Catches: a decoder in which the first of two values wins; the wire says the last.
TEST(SampleCodec, OfARepeatedScalarTheLastCounts) {
  EXPECT_EQ(decode_sample(bytes_of("\x08\x05\x08\x07"))->tick, 7u);
}

v1::Envelope envelope_of(const std::vector<std::byte>& frame) {
  EXPECT_GE(frame.size(), kFrameHeaderSize);
  const auto header = frame_header(static_cast<std::uint32_t>(frame.size() - kFrameHeaderSize));
  EXPECT_TRUE(std::equal(header.begin(), header.end(), frame.begin())) << "the length of the frame";
  v1::Envelope envelope;
  EXPECT_TRUE(envelope.ParseFromArray(frame.data() + kFrameHeaderSize,
                                      static_cast<int>(frame.size() - kFrameHeaderSize)));
  return envelope;
}

// Catches: a field number of the frames written by hand that differs from bench.proto, in any position.
TEST(SampleCodec, HandWrittenFramesReadBackThroughProtobuf) {
  Sample first;
  first.tick = 100;
  first.i_a_a = -0.0;
  Sample second;
  second.tick = 101;
  second.psi_b_wb = std::bit_cast<double>(kNanWithPayload);

  std::vector<std::byte> out;
  append_exchange_reply(out, 0xffff'ffff'ffffu, std::to_array<AxisSampleView>({{0, &first}, {300, &second}}));
  v1::Envelope envelope = envelope_of(out);
  EXPECT_EQ(envelope.id(), 0xffff'ffff'ffffu);
  ASSERT_EQ(envelope.kind_case(), v1::Envelope::kExchangeReply);
  ASSERT_EQ(envelope.exchange_reply().samples_size(), 2);
  EXPECT_EQ(envelope.exchange_reply().samples(0).axis(), 0u);
  EXPECT_EQ(envelope.exchange_reply().samples(0).sample().tick(), 100u);
  EXPECT_TRUE(std::signbit(envelope.exchange_reply().samples(0).sample().i_a_a()));
  EXPECT_EQ(envelope.exchange_reply().samples(0).sample().command_tick(), -1);
  EXPECT_EQ(envelope.exchange_reply().samples(1).axis(), 300u);
  EXPECT_EQ(std::bit_cast<std::uint64_t>(envelope.exchange_reply().samples(1).sample().psi_b_wb()),
            kNanWithPayload);

  out.clear();
  const std::array<Sample, 2> both{first, second};
  append_samples(out, 5, 1234567, both, find_signal("tick") == nullptr ? 0 : SignalMask{1});
  envelope = envelope_of(out);
  EXPECT_EQ(envelope.id(), 0u);
  ASSERT_EQ(envelope.kind_case(), v1::Envelope::kSamples);
  EXPECT_EQ(envelope.samples().axis(), 5u);
  EXPECT_EQ(envelope.samples().dropped(), 1234567u);
  ASSERT_EQ(envelope.samples().samples_size(), 2);
  EXPECT_EQ(envelope.samples().samples(1).tick(), 101u);
  EXPECT_EQ(envelope.samples().samples(0).command_tick(), 0) << "masked out";
}

// Catches: frames appended to a buffer that already holds one, and an empty one.
TEST(SampleCodec, FramesMayFollowEachOtherInOneBuffer) {
  const Sample sample{.tick = 9};
  std::vector<std::byte> out;
  append_samples(out, 1, 0, {}, kAllSignals);
  const std::size_t first = out.size();
  append_exchange_reply(out, 2, std::to_array<AxisSampleView>({{0, &sample}}));
  EXPECT_EQ(envelope_of({out.begin(), out.begin() + static_cast<std::ptrdiff_t>(first)}).samples().axis(),
            1u);
  EXPECT_EQ(envelope_of({out.begin() + static_cast<std::ptrdiff_t>(first), out.end()}).id(), 2u);
}

// Catches: a nested length that overflows its three bytes: the most that one message carries, at its largest.
TEST(SampleCodec, TheLargestBatchKeepsItsLengths) {
  Sample sample;
  for (const Signal& signal : kSignals)
    set_word(sample, signal, ~0ull);
  std::vector<std::byte> out;
  append_samples(out, 63, ~0ull, {&sample, 1}, kAllSignals);
  const std::size_t most = kMaxReplyFrame / out.size();
  const std::vector<Sample> batch(most, sample);
  out.clear();
  append_samples(out, 63, ~0ull, batch, kAllSignals);
  ASSERT_LE(out.size(), kMaxReplyFrame + kFrameHeaderSize);
  ASSERT_GT(out.size(), kMaxReplyFrame * 9 / 10);
  EXPECT_EQ(envelope_of(out).samples().samples_size(), static_cast<int>(most));
}

// Catches: a varint that is read differently from how it is written.
TEST(Wire, VarintsAndZigzagRoundTrip) {
  for (const std::uint64_t value : kTrickyWords) {
    std::array<std::byte, 10> bytes;
    const std::byte* const end = wire::put_varint(bytes.data(), value);
    std::uint64_t back = 0;
    EXPECT_EQ(wire::get_varint(bytes.data(), end, back), end);
    EXPECT_EQ(back, value);
    EXPECT_EQ(wire::get_varint(bytes.data(), end - 1, back), nullptr) << "cut off";
    const auto as_signed = static_cast<std::int64_t>(value);
    EXPECT_EQ(wire::unzigzag(wire::zigzag(as_signed)), as_signed);
  }
  EXPECT_EQ(wire::zigzag(-1), 1u);
  EXPECT_EQ(wire::zigzag(1), 2u);
}

}  // namespace
}  // namespace drivebench::sample_codec_test
