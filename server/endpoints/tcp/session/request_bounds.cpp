#include "server/endpoints/tcp/session/request_bounds.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "protocols/framing.hpp"
#include "protocols/signals/catalogue.hpp"
#include "protocols/signals/command.hpp"
#include "server/config/config.hpp"
#include "server/endpoints/tcp/capture/capture.hpp"
#include "server/experiments/plan.hpp"

namespace drivebench {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

constexpr auto kRequestKinds = std::to_array<v1::Envelope::KindCase>({
    v1::Envelope::kHello,           v1::Envelope::kLease,
    v1::Envelope::kExchange,        v1::Envelope::kSubscribe,
    v1::Envelope::kReadParameters,  v1::Envelope::kWriteParameter,
    v1::Envelope::kSetLoad,         v1::Envelope::kClearFaults,
    v1::Envelope::kStatusRequest,   v1::Envelope::kInjectFault,
    v1::Envelope::kShaftBump,       v1::Envelope::kRunExperiment,
    v1::Envelope::kUploadTable,     v1::Envelope::kListExperiments,
    v1::Envelope::kFetchExperiment, v1::Envelope::kCancelExperiment,
    v1::Envelope::kSaveState,       v1::Envelope::kRestoreState,
    v1::Envelope::kResetBench,      v1::Envelope::kShareMemory,
    v1::Envelope::kTrigger,         v1::Envelope::kReadCapture,
    v1::Envelope::kShareBridge,
});

/// The repeated fields of all requests.
struct Bound {
  std::string_view kind;  ///< the field of Envelope
  std::string_view path;  ///< from there
  std::size_t most;       ///< elements in a frame
};
constexpr std::size_t kMaxNames = 256;                      // more than an axis has parameters
constexpr std::size_t kMaxEdges = kMaxAxes * kMaxLegEdges;  // of legs with one letter
constexpr auto kBounds = std::to_array<Bound>({
    {"exchange", "commands", kMaxAxes},
    {"exchange", "commands.edges_a", kMaxEdges},
    {"exchange", "commands.edges_b", kMaxEdges},
    {"exchange", "commands.edges_c", kMaxEdges},
    {"subscribe", "signals", kSignals.size()},
    {"trigger", "captured", kMaxAxes},
    {"trigger", "captured.signals", CaptureSettings::kMaxChannels},
    {"read_parameters", "names", kMaxNames},
    {"run_experiment", "signals", kSignals.size()},
    {"run_experiment", "settings", kMaxPlannedEvents},
    {"run_experiment", "events", kMaxPlannedEvents},
    {"run_experiment", "input.shapes", kMaxShapes},
    {"run_experiment", "input.shapes.multisine.harmonics", kMaxHarmonics},
    {"upload_table", "times_s", kMaxRequestFrame / sizeof(double)},
    {"upload_table", "values", kMaxRequestFrame / sizeof(double)},
});
using Fields = std::array<const FieldDescriptor*, kBounds.size()>;

const FieldDescriptor* find(const Bound& bound) {
  const FieldDescriptor* field = v1::Envelope::descriptor()->FindFieldByName(std::string(bound.kind));
  for (std::string_view path = bound.path; !path.empty();) {
    const std::string_view name = path.substr(0, path.find('.'));
    field = field->message_type()->FindFieldByName(std::string(name));
    path.remove_prefix(std::min(path.size(), name.size() + 1));
  }
  return field;
}

/// In the order of kBounds.
const Fields& bounded_fields() {
  static const Fields kFields = [] {
    Fields fields{};
    std::ranges::transform(kBounds, fields.begin(), find);
    return fields;
  }();
  return kFields;
}

/// The row of kBounds; the number of rows if there is none.
std::size_t row_of(const FieldDescriptor& repeated) {
  return static_cast<std::size_t>(std::ranges::find(bounded_fields(), &repeated) - bounded_fields().begin());
}

/// The low bits of a tag.
enum WireType : std::uint32_t {
  kVarint = 0,
  kFixed64 = 1,
  kBytes = 2,
  kGroup = 3,
  kGroupEnd = 4,
  kFixed32 = 5
};

WireType wire_type_of(const FieldDescriptor& field) {
  switch (field.type()) {
    case FieldDescriptor::TYPE_DOUBLE:
    case FieldDescriptor::TYPE_FIXED64:
    case FieldDescriptor::TYPE_SFIXED64:
      return kFixed64;
    case FieldDescriptor::TYPE_FLOAT:
    case FieldDescriptor::TYPE_FIXED32:
    case FieldDescriptor::TYPE_SFIXED32:
      return kFixed32;
    case FieldDescriptor::TYPE_STRING:
    case FieldDescriptor::TYPE_BYTES:
    case FieldDescriptor::TYPE_MESSAGE:
      return kBytes;
    case FieldDescriptor::TYPE_GROUP:
      return kGroup;
    default:
      return kVarint;
  }
}

/// The elements of a packed field.
std::size_t packed_elements(const FieldDescriptor& field, std::span<const std::byte> content) {
  switch (wire_type_of(field)) {
    case kFixed64:
      return content.size() / 8;
    case kFixed32:
      return content.size() / 4;
    default:  // the last byte of a varint has no high bit
      return static_cast<std::size_t>(
          std::ranges::count_if(content, [](std::byte b) { return (b & std::byte{0x80}) == std::byte{0}; }));
  }
}

/// Walks over the wire format of an Envelope and counts. It allocates nothing and looks at each byte once.
class FrameCount {
 public:
  explicit FrameCount(std::span<const std::byte> frame)
      : at_(frame.data()), is_envelope_(message(v1::Envelope::descriptor(), at_ + frame.size(), 0)) {}

  bool is_envelope() const noexcept { return is_envelope_; }
  std::uint64_t id() const noexcept { return id_; }
  v1::Envelope::KindCase kind() const noexcept { return kind_; }          ///< the last one
  const FieldDescriptor* no_request() const noexcept { return answer_; }  ///< a kind that only servers send
  std::size_t fields() const noexcept { return fields_; }
  std::size_t unknown() const noexcept { return unknown_; }
  std::size_t replaced() const noexcept { return replaced_; }  ///< members of a oneof, by others of it
  /// Of the repeated field in this row of kBounds.
  std::size_t elements(std::size_t bound) const noexcept { return elements_[bound]; }

 private:
  bool varint(const std::byte* end, std::uint64_t& value) noexcept {
    value = 0;
    for (unsigned shift = 0; shift < 64 && at_ != end; shift += 7) {
      const auto byte = std::to_integer<std::uint64_t>(*at_++);
      value |= (byte & 0x7F) << shift;
      if (byte < 0x80) return true;
    }
    return false;
  }

  bool skip(const std::byte* end, std::uint64_t count) noexcept {
    if (static_cast<std::uint64_t>(end - at_) < count) return false;
    at_ += count;
    return true;
  }

  /// The fields up to `end`, or to the end of this group. No type: they are unknown.
  bool message(const Descriptor* type, const std::byte* end, int depth, std::uint32_t group = 0) {
    if (depth > kMaxRequestNesting) return false;
    const FieldDescriptor* chosen = nullptr;  // of the oneof
    while (at_ != end) {
      std::uint64_t tag = 0;
      if (!varint(end, tag) || tag > 0xFFFFFFFF || tag >> 3 == 0) return false;
      const auto number = static_cast<std::uint32_t>(tag >> 3);
      const auto wire = static_cast<WireType>(tag & 7);
      if (wire == kGroupEnd) return number == group;
      // A frame with too many fields is refused: only its end and its id are still of interest.
      const bool is_id = depth == 0 && number == v1::Envelope::kIdFieldNumber;
      const bool is_known = type != nullptr && (fields_ < kMaxRequestFields || is_id);
      const FieldDescriptor* const field =
          is_known ? type->FindFieldByNumber(static_cast<int>(number)) : nullptr;
      if (!one_field(field, number, wire, end, depth)) return false;
      if (field == nullptr || field->real_containing_oneof() == nullptr) continue;
      if (chosen != nullptr && chosen != field) ++replaced_;
      chosen = field;
    }
    return group == 0;
  }

  bool one_field(const FieldDescriptor* field, std::uint32_t number, WireType wire, const std::byte* end,
                 int depth) {
    ++fields_;
    const bool is_packed = field != nullptr && wire == kBytes && field->is_packable();
    if (field != nullptr && !is_packed && wire != wire_type_of(*field)) field = nullptr;
    if (field == nullptr) ++unknown_;
    std::uint64_t value = 0;
    switch (wire) {
      case kVarint:
        if (!varint(end, value)) return false;
        if (field != nullptr && depth == 0) id_ = value;  // the only such field of Envelope
        break;
      case kFixed64:
        if (!skip(end, 8)) return false;
        break;
      case kFixed32:
        if (!skip(end, 4)) return false;
        break;
      case kGroup:
        return message(nullptr, end, depth + 1, number);
      case kBytes: {
        const bool is_length = varint(end, value);
        const std::byte* const begin = at_;
        if (!is_length || !skip(end, value)) return false;
        if (is_packed) return count(*field, packed_elements(*field, {begin, at_}));
        if (field != nullptr && field->message_type() != nullptr && !submessage(*field, begin, depth))
          return false;
        break;
      }
      default:
        return false;
    }
    return field == nullptr || !field->is_repeated() || count(*field, 1);
  }

  /// A message between `begin` and the place that has been reached. Nothing looks into a kind that is no
  /// request.
  bool submessage(const FieldDescriptor& field, const std::byte* begin, int depth) {
    if (depth == 0) kind_ = static_cast<v1::Envelope::KindCase>(field.number());
    if (!is_request(kind_)) answer_ = &field;
    if (answer_ != nullptr) return true;
    const std::byte* const end = at_;
    at_ = begin;
    return message(field.message_type(), end, depth + 1);
  }

  bool count(const FieldDescriptor& repeated, std::size_t elements) {
    elements_[row_of(repeated)] += elements;
    return true;
  }

  const std::byte* at_;
  std::uint64_t id_ = 0;
  v1::Envelope::KindCase kind_ = v1::Envelope::KIND_NOT_SET;
  const FieldDescriptor* answer_ = nullptr;
  std::size_t fields_ = 0;
  std::size_t unknown_ = 0;
  std::size_t replaced_ = 0;
  std::array<std::size_t, kBounds.size() + 1> elements_{};  // the last one: of no row
  bool is_envelope_;
};

/// The refusal of the frame; empty: it is not refused.
std::optional<FrameReading> problem_with(const FrameCount& count) {
  const auto refusal = [&count](v1::RefusalCode code, std::string sentence, std::string field) {
    return FrameReading{.outcome = FrameReading::Outcome::kRefused,
                        .id = count.id(),
                        .kind = count.kind(),
                        .code = code,
                        .sentence = std::move(sentence),
                        .field = std::move(field)};
  };
  if (count.kind() == v1::Envelope::KIND_NOT_SET) {
    return refusal(v1::REFUSAL_MALFORMED, "the envelope holds no request", "kind");
  }
  if (count.no_request() != nullptr) {
    return refusal(v1::REFUSAL_MALFORMED, count.no_request()->name() + " is not a request", "kind");
  }
  const auto too_many = [&](std::size_t there, const std::string& what, std::size_t most,
                            const std::string& field) {
    return refusal(v1::REFUSAL_OUT_OF_RANGE,
                   fmt::format("the request has {} {} but may have {}", there, what, most), field);
  };
  if (count.replaced() > kMaxReplacedFields) {
    return too_many(count.replaced(), "fields that others take the place of", kMaxReplacedFields, "frame");
  }
  if (count.fields() > kMaxRequestFields) {
    return too_many(count.fields(), "fields", kMaxRequestFields, "frame");
  }
  for (std::size_t row = 0; row < kBounds.size(); ++row) {
    const Bound& bound = kBounds[row];
    if (count.elements(row) <= bound.most) continue;
    const std::string path(bound.path);
    return too_many(count.elements(row), path, bound.most, path);
  }
  if (count.unknown() > kMaxUnknownFields) {
    return too_many(count.unknown(), "fields that this server does not know", kMaxUnknownFields, "frame");
  }
  return std::nullopt;
}

}  // namespace

std::size_t most_elements(const FieldDescriptor& repeated) {
  const std::size_t row = row_of(repeated);
  return row == kBounds.size() ? 0 : kBounds[row].most;
}

bool is_request(v1::Envelope::KindCase kind) noexcept {
  return std::ranges::find(kRequestKinds, kind) != kRequestKinds.end();
}

FrameReading read_request(std::span<const std::byte> frame, v1::Envelope& request) {
  FrameReading no_envelope{.outcome = FrameReading::Outcome::kNoEnvelope,
                           .sentence = "the frame is not an Envelope",
                           .field = "frame"};
  const FrameCount count(frame);
  if (!count.is_envelope()) return no_envelope;
  if (std::optional<FrameReading> problem = problem_with(count)) return *std::move(problem);
  if (!request.ParseFromArray(frame.data(), static_cast<int>(frame.size()))) return no_envelope;
  return {.id = request.id(), .kind = request.kind_case()};
}

}  // namespace drivebench
