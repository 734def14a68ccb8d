#include "server/endpoints/tcp/session/request_bounds.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "protocols/framing.hpp"
#include "tests/fuzz/quiet_protobuf.hpp"
#include "tests/fuzz/request_program.hpp"
#include "tests/fuzz/request_promises.hpp"
#include "tests/repetitions.hpp"

namespace drivebench::request_bounds_test {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using Outcome = FrameReading::Outcome;

FrameReading reading_of(const std::string& frame) {
  v1::Envelope request;
  return read_request(std::as_bytes(std::span(frame)), request);
}

FrameReading reading_of(const v1::Envelope& envelope) {
  return reading_of(envelope.SerializeAsString());
}

/// A field of a message in a field of Envelope, so many times.
std::string many(std::uint32_t kind, std::uint32_t number, const std::string& content, std::size_t count) {
  return fuzz::wire::tagged(kind, 2, fuzz::wire::repeated(fuzz::wire::tagged(number, 2, content), count));
}

void collect_repeated(const Descriptor& type, std::set<const FieldDescriptor*>& seen) {
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor* const field = type.field(i);
    if (field->is_repeated()) seen.insert(field);
    if (field->message_type() != nullptr) collect_repeated(*field->message_type(), seen);
  }
}

// Catches: a request with a new repeated field that has no bound, so that every message with it is refused; a
// bound for a field of no request.
TEST(RequestBounds, EveryRepeatedFieldOfARequestHasABound) {
  std::set<const FieldDescriptor*> seen;
  const Descriptor& envelope = *v1::Envelope::descriptor();
  for (int i = 0; i < envelope.field_count(); ++i) {
    const FieldDescriptor& field = *envelope.field(i);
    if (!is_request(static_cast<v1::Envelope::KindCase>(field.number()))) continue;
    collect_repeated(*field.message_type(), seen);
  }
  EXPECT_EQ(seen.size(), 15u);
  for (const FieldDescriptor* const field : seen)
    EXPECT_GT(most_elements(*field), 0u) << field->full_name();
  EXPECT_EQ(most_elements(*v1::Samples::descriptor()->FindFieldByName("samples")), 0u);
}

// Catches: an answer that is parsed before it is refused: 32,000 empty samples come to 13 MB.
TEST(RequestBounds, TCP_05_AKindThatIsNoRequestIsRefusedByItsTag) {
  const std::string samples = many(10, 3, "", 32'000);
  const std::string frame = "\x08\x07" + samples;
  FrameReading reading = reading_of(frame);  // the first frame of a process makes the descriptors
  const fuzz::Taken taken = fuzz::taken_by([&] { reading = reading_of(frame); });
  EXPECT_EQ(reading.outcome, Outcome::kRefused);
  EXPECT_EQ(reading.id, 7u);
  EXPECT_EQ(reading.code, v1::REFUSAL_MALFORMED);
  EXPECT_EQ(reading.field, "kind");
  EXPECT_EQ(reading.sentence, "samples is not a request");
  EXPECT_LT(taken.peak_bytes, 1024u);
  v1::Envelope status;
  status.mutable_status_request();
  EXPECT_EQ(reading_of(samples + status.SerializeAsString()).sentence, "samples is not a request")
      << "protobuf would parse it before it takes the last kind";
  EXPECT_EQ(reading_of("\x08\x07").sentence, "the envelope holds no request");
}

// Catches: a bound that is one too low or too high, or that parts of a message in two pieces get round.
TEST(RequestBounds, TCP_05_LIMIT_11_ElementsAreCountedInTheWholeFrame) {
  v1::Envelope request;
  for (int i = 0; i < 64; ++i)
    request.mutable_exchange()->add_commands();
  EXPECT_EQ(reading_of(request).outcome, Outcome::kRequest);
  const std::string one_more = request.SerializeAsString() + many(7, 1, "", 1);
  const FrameReading reading = reading_of(one_more);
  EXPECT_EQ(reading.outcome, Outcome::kRefused);
  EXPECT_EQ(reading.code, v1::REFUSAL_OUT_OF_RANGE);
  EXPECT_EQ(reading.field, "commands");
  EXPECT_EQ(reading.sentence, "the request has 65 commands but may have 64");

  v1::Envelope experiment;
  v1::ExperimentInput& input = *experiment.mutable_run_experiment()->mutable_input();
  for (std::uint32_t shape = 0; shape < 2; ++shape) {
    v1::Shape::Multisine& multisine = *input.add_shapes()->mutable_multisine();
    for (std::uint32_t n = 0; n < 500; ++n)
      multisine.add_harmonics(n + 1000 * shape);  // of one and of two bytes, packed
  }
  EXPECT_EQ(reading_of(experiment).outcome, Outcome::kRequest);
  input.mutable_shapes(0)->mutable_multisine()->add_harmonics(70'000);
  EXPECT_EQ(reading_of(experiment).sentence,
            "the request has 1001 input.shapes.multisine.harmonics but may have 1000");
}

// Catches: a client that packs no numbers, whose table is refused.
TEST(RequestBounds, ATableMayBeUnpacked) {
  using fuzz::wire::repeated;
  using fuzz::wire::tagged;
  const std::string time = tagged(3, 1, std::string(8, '\0'));
  const std::string table = tagged(22, 2, repeated(time, kMaxRequestFrame));
  EXPECT_GT(table.size(), kMaxRequestFrame - 128);
  EXPECT_EQ(reading_of(table).outcome, Outcome::kRequest);
}

// Catches: additions of newer clients that are refused; unknown fields without end, which protobuf keeps.
TEST(RequestBounds, TCP_07_LIMIT_11_AFewUnknownFieldsAreIgnored) {
  using fuzz::wire::repeated;
  using fuzz::wire::tagged;
  const std::string status = tagged(16, 2, "");
  const std::string varint = tagged(2000, 0, "\1");
  const std::string wrong_type = tagged(1, 2, "id");  // `id` is a number
  const std::string group = tagged(2000, 3, varint + tagged(2000, 4, ""));
  for (const auto& [part, each] : {std::pair{varint, 1}, {wrong_type, 1}, {group, 2}}) {
    const std::size_t most = kMaxUnknownFields / static_cast<std::size_t>(each);
    EXPECT_EQ(reading_of(status + repeated(part, most)).outcome, Outcome::kRequest);
    const FrameReading reading = reading_of(status + repeated(part, most + 1));
    EXPECT_EQ(reading.outcome, Outcome::kRefused);
    EXPECT_EQ(reading.sentence, "the request has " +
                                    std::to_string(kMaxUnknownFields + static_cast<std::size_t>(each)) +
                                    " fields that this server does not know but may have 64");
  }
  EXPECT_EQ(reading_of(tagged(16, 2, repeated(varint, 65))).outcome, Outcome::kRefused) << "within the kind";
}

// Catches: a field that is written ten thousand times, each time with an allocation.
TEST(RequestBounds, TCP_05_LIMIT_11_AFrameHasAsManyFieldsAsTheLongestRequest) {
  using fuzz::wire::repeated;
  using fuzz::wire::tagged;
  const std::string lease = tagged(6, 2, "");
  EXPECT_EQ(reading_of(repeated(lease, 8192)).outcome, Outcome::kRequest);
  EXPECT_EQ(reading_of(repeated(lease, 8193)).sentence, "the request has 8193 fields but may have 8192");
}

// Catches: a frame that names a long owner and asks for the status in turn: four allocations for three
// fields, 8,449 in all, which a search found; an event or a shape that does the same within a request.
TEST(RequestBounds, TCP_05_LIMIT_11_FewMembersOfAOneofAreReplaced) {
  using fuzz::wire::repeated;
  using fuzz::wire::tagged;
  const std::string cancel = tagged(28, 2, tagged(2, 2, std::string(23, 'r')));
  const std::string switching = cancel + tagged(16, 2, "");
  EXPECT_EQ(reading_of(repeated(switching, 4) + cancel).outcome, Outcome::kRequest);
  EXPECT_EQ(reading_of(repeated(switching, 4)).kind, v1::Envelope::kStatusRequest);
  const FrameReading reading = reading_of(repeated(switching, 5));
  EXPECT_EQ(reading.outcome, Outcome::kRefused);
  EXPECT_EQ(reading.field, "frame");
  EXPECT_EQ(reading.sentence, "the request has 9 fields that others take the place of but may have 8");
  const std::string name = tagged(1, 2, std::string(16, 'n'));
  const std::string event = repeated(tagged(6, 2, name) + tagged(7, 2, name), 1600);
  const std::string shape =
      repeated(tagged(11, 2, tagged(3, 2, std::string(16, 'f'))) + tagged(4, 2, ""), 2000);
  for (const std::string& frame : {repeated(switching, kMaxRequestFrame), many(20, 15, event, 1),
                                   many(20, 14, tagged(4, 2, shape), 1)}) {
    EXPECT_EQ(reading_of(frame).outcome, Outcome::kRefused);
    EXPECT_EQ(fuzz::cost_of(frame).broken, "");
  }
}

// Catches: a count that goes on beyond the end of a part, or takes it for another.
TEST(RequestBounds, BytesThatAreNoEnvelopeAreFound) {
  using fuzz::wire::tagged;
  for (const std::string& bytes :
       {std::string("\x08"), std::string("\x08\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"),
        std::string("\0\0", 2), std::string("\x3a\x05\x0a\x00", 4), std::string("\x3a\x02\x0a\x01", 4),
        std::string("\x0c"), std::string("\x0b\x14"), std::string("\x0b"), std::string("\x0e"),
        std::string("\x09\x01\x02"), tagged(13, 2, tagged(2, 2, "\xff\xfe"))}) {
    EXPECT_EQ(reading_of(bytes).outcome, Outcome::kNoEnvelope) << ::testing::PrintToString(bytes);
    EXPECT_EQ(reading_of(bytes).id, 0u);
  }
  std::string nested = tagged(2000, 0, "\1");
  for (int depth = 1; depth <= kMaxRequestNesting + 1; ++depth) {
    nested = tagged(2000, 3, nested + tagged(2000, 4, ""));
    EXPECT_EQ(reading_of(tagged(16, 2, "") + nested).outcome == Outcome::kRequest,
              depth <= kMaxRequestNesting);
  }
}

std::size_t bytes_of_protobuf(const std::string& frame) {
  return fuzz::taken_by([&frame] { v1::Envelope().ParseFromString(frame); }).peak_bytes;
}
std::size_t bytes_of_request(const std::string& frame) {
  return fuzz::cost_of(frame).taken.peak_bytes;
}
std::size_t allocations_of_request(const std::string& frame) {
  return fuzz::cost_of(frame).taken.calls;
}

// Catches: a frame of which the server makes more than its bounds allow. The same search without the bounds
// shows that it finds such frames.
TEST(RequestBounds, TCP_05_ASearchFindsNoFrameThatTakesMuch) {
  if (kSanitized) GTEST_SKIP() << "an ordinary build searches; Fuzz.request has such frames for this one";
  fuzz::silence_protobuf();
  constexpr std::uint64_t kSeed = 20261123;
  const auto worst_frame = [](auto score, std::uint64_t seed) {
    return fuzz::frame_of(fuzz::worst_program(score, seed));
  };
  // A search may end on a lower hill than the next one.
  const auto worst_above = [&](auto score, std::size_t wanted) {
    std::string frame;
    for (std::uint64_t seed = kSeed; seed < kSeed + 8 && score(frame) <= wanted; ++seed)
      frame = worst_frame(score, seed);
    return frame;
  };
  constexpr std::size_t kMuch = std::size_t{4} << 20;
  const std::string without = worst_above(bytes_of_protobuf, kMuch);
  EXPECT_GT(bytes_of_protobuf(without), kMuch);
  EXPECT_LT(bytes_of_request(without), fuzz::kMostParsedBytes);
  const fuzz::FrameCost most_bytes = fuzz::cost_of(worst_above(bytes_of_request, kMaxRequestFrame));
  EXPECT_EQ(most_bytes.broken, "");
  EXPECT_GT(most_bytes.taken.peak_bytes, kMaxRequestFrame) << "the search climbs";
  const fuzz::FrameCost most_calls = fuzz::cost_of(worst_above(allocations_of_request, 512));
  EXPECT_EQ(most_calls.broken, "");
  EXPECT_GT(most_calls.taken.calls, 512u) << "the search climbs";
  RecordProperty("bytes", std::to_string(most_bytes.taken.peak_bytes));
  RecordProperty("allocations", std::to_string(most_calls.taken.calls));
}

}  // namespace
}  // namespace drivebench::request_bounds_test
