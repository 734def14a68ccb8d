#include "protocols/sample_codec.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "protocols/framing.hpp"
#include "protocols/wire.hpp"

namespace drivebench {
namespace {

/// The members of a sample; row n of the catalogue is member n.
using SampleWords = std::array<std::uint64_t, kSampleWords>;

/// Encodes one signal. The row is a template argument, so that the table becomes straight-line code.
template <std::size_t Row>
std::byte* put_signal(std::byte* out, std::uint64_t word) noexcept {
  constexpr SignalType kType = kSignals[Row].type;
  constexpr auto kField = static_cast<std::uint32_t>(Row + 1);
  if (word == 0) return out;
  if constexpr (kType == SignalType::kReal) {
    return wire::put_fixed64(wire::put_varint(out, wire::tag(kField, wire::kFixed64)), word);
  } else {
    const std::uint64_t value =
        kType == SignalType::kUnsigned ? word : wire::zigzag(std::bit_cast<std::int64_t>(word));
    return wire::put_varint(wire::put_varint(out, wire::tag(kField, wire::kVarint)), value);
  }
}

/// All signals, or those of the mask.
template <bool kAll>
std::byte* put_signals(std::byte* out, const SampleWords& words, SignalMask mask) noexcept {
  const auto put_all = [&]<std::size_t... Row>(std::index_sequence<Row...>) {
    ((out = kAll || (mask >> Row & 1) != 0 ? put_signal<Row>(out, words[Row]) : out), ...);
  };
  put_all(std::make_index_sequence<kSignals.size()>{});
  return out;
}

void store(Sample& sample, const Signal& signal, std::uint64_t value) noexcept {
  switch (signal.type) {
    case SignalType::kUnsigned:
      sample.*signal.as_unsigned = value;
      break;
    case SignalType::kSigned:
      sample.*signal.as_signed = wire::unzigzag(value);
      break;
    case SignalType::kReal:
      sample.*signal.as_real = std::bit_cast<double>(value);
      break;
  }
}

/// A sample of zeros, the values that proto3 leaves out.
constexpr Sample zero_sample() noexcept {
  Sample sample;
  sample.command_tick = 0;
  sample.index_tick = 0;
  return sample;
}

}  // namespace

std::size_t encode_sample(const Sample& sample, SignalMask mask, std::byte* out) noexcept {
  const auto words = std::bit_cast<SampleWords>(sample);
  const std::byte* const end =
      mask == kAllSignals ? put_signals<true>(out, words, mask) : put_signals<false>(out, words, mask);
  return static_cast<std::size_t>(end - out);
}

namespace {

// Field numbers of bench.proto; a test compares them with the descriptors.
constexpr std::uint32_t kEnvelopeId = 1;
constexpr std::uint32_t kEnvelopeExchangeReply = 8;
constexpr std::uint32_t kEnvelopeSamples = 10;
constexpr std::uint32_t kExchangeReplySamples = 1;
constexpr std::uint32_t kAxisSampleAxis = 1;
constexpr std::uint32_t kAxisSampleSample = 2;
constexpr std::uint32_t kSamplesAxis = 1;
constexpr std::uint32_t kSamplesDropped = 2;
constexpr std::uint32_t kSamplesSamples = 3;

/// Appends protobuf fields to a buffer. The length of a nested message is known only at its end, so it gets a
/// fixed three bytes.
class MessageWriter {
 public:
  explicit MessageWriter(std::vector<std::byte>& out) : out_(out) {}

  std::byte* room(std::size_t size) {
    out_.resize(out_.size() + size);
    return out_.data() + out_.size() - size;
  }
  void used(const std::byte* end) { out_.resize(static_cast<std::size_t>(end - out_.data())); }

  void varint(std::uint32_t field, std::uint64_t value) {
    if (value == 0) return;
    used(wire::put_varint(wire::put_varint(room(20), wire::tag(field, wire::kVarint)), value));
  }

  /// Opens a nested message and returns the argument for close().
  std::size_t open(std::uint32_t field) {
    used(wire::put_varint(room(5), wire::tag(field, wire::kBytes)));
    room(kLengthBytes);
    return out_.size();
  }
  void close(std::size_t begin) {
    std::uint64_t size = out_.size() - begin;
    for (std::size_t i = 0; i < kLengthBytes; ++i, size >>= 7) {
      out_[begin - kLengthBytes + i] = std::byte((size & 0x7f) | (i + 1 < kLengthBytes ? 0x80 : 0));
    }
  }

  void sample(std::uint32_t field, const Sample& sample, SignalMask mask) {
    const std::size_t begin = open(field);
    std::byte* const out = room(kMaxSampleBytes);
    used(out + encode_sample(sample, mask, out));
    close(begin);
  }

 private:
  static constexpr std::size_t kLengthBytes = 3;  // lengths below 2 MiB; frames end at 1 MiB

  std::vector<std::byte>& out_;
};

/// Reserves the header of a frame and fills it in at destruction.
class FrameWriter {
 public:
  explicit FrameWriter(std::vector<std::byte>& out) : out_(out), begin_(out.size()) {
    out_.resize(begin_ + kFrameHeaderSize);
  }
  ~FrameWriter() {
    const auto header = frame_header(static_cast<std::uint32_t>(out_.size() - begin_ - kFrameHeaderSize));
    std::copy(header.begin(), header.end(), out_.begin() + static_cast<std::ptrdiff_t>(begin_));
  }
  FrameWriter(const FrameWriter&) = delete;
  FrameWriter& operator=(const FrameWriter&) = delete;

 private:
  std::vector<std::byte>& out_;
  std::size_t begin_;
};

}  // namespace

void append_exchange_reply(std::vector<std::byte>& out, std::uint64_t id,
                           std::span<const AxisSampleView> samples) {
  const FrameWriter frame(out);
  MessageWriter writer(out);
  writer.varint(kEnvelopeId, id);
  const std::size_t reply = writer.open(kEnvelopeExchangeReply);
  for (const AxisSampleView& view : samples) {
    const std::size_t axis_sample = writer.open(kExchangeReplySamples);
    writer.varint(kAxisSampleAxis, view.axis);
    writer.sample(kAxisSampleSample, *view.sample, kAllSignals);
    writer.close(axis_sample);
  }
  writer.close(reply);
}

void append_samples(std::vector<std::byte>& out, std::uint32_t axis, std::uint64_t dropped,
                    std::span<const Sample> samples, SignalMask mask) {
  const FrameWriter frame(out);
  MessageWriter writer(out);
  const std::size_t message = writer.open(kEnvelopeSamples);
  writer.varint(kSamplesAxis, axis);
  writer.varint(kSamplesDropped, dropped);
  for (const Sample& sample : samples)
    writer.sample(kSamplesSamples, sample, mask);
  writer.close(message);
}

std::optional<Sample> decode_sample(std::span<const std::byte> bytes) noexcept {
  Sample sample = zero_sample();
  const std::byte* in = bytes.data();
  const std::byte* const end = in + bytes.size();
  while (in != end) {
    std::uint64_t tag = 0;
    in = wire::get_varint(in, end, tag);
    if (in == nullptr) return std::nullopt;
    const std::uint64_t row = (tag >> 3) - 1;
    if (row >= kSignals.size()) return std::nullopt;
    const bool real = kSignals[row].type == SignalType::kReal;
    if ((tag & 7) != (real ? wire::kFixed64 : wire::kVarint)) return std::nullopt;
    std::uint64_t value = 0;
    if (real) {
      if (end - in < 8) return std::nullopt;
      std::memcpy(&value, in, sizeof(value));
      in += sizeof(value);
    } else {
      in = wire::get_varint(in, end, value);
      if (in == nullptr) return std::nullopt;
    }
    store(sample, kSignals[row], value);
  }
  return sample;
}

}  // namespace drivebench
