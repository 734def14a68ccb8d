#include "server/endpoints/tcp/session/requests/fetch.hpp"

#include <fmt/core.h>
#include <google/protobuf/io/coded_stream.h>

#include <algorithm>
#include <span>

#include "protocols/framing.hpp"
#include "server/endpoints/tcp/session/requests/experiment_requests.hpp"

namespace drivebench {
namespace {

using google::protobuf::io::CodedOutputStream;

/// Bytes of rows or of the recording in one message; small enough that a client's memory comes from its
/// heap.
constexpr std::size_t kChunkBytes = std::size_t{64} * 1024;
/// The most bytes of a session in a turn.
constexpr std::size_t kTurnBytes = 8 * kChunkBytes;
/// Size of the socket's send buffer during a fetch, if the system allows it: the server makes the next
/// message while the client reads this one.
constexpr int kFetchBufferBytes = 512 * 1024;
constexpr auto kInfoInterval = std::chrono::milliseconds(200);
constexpr std::uint32_t kLengthDelimited = 2;

std::uint8_t* put_tag(int field, std::uint32_t length, std::uint8_t* out) {
  out = CodedOutputStream::WriteVarint32ToArray((static_cast<std::uint32_t>(field) << 3) | kLengthDelimited,
                                                out);
  return CodedOutputStream::WriteVarint32ToArray(length, out);
}

std::size_t tag_size(int field, std::size_t length) {
  return CodedOutputStream::VarintSize32((static_cast<std::uint32_t>(field) << 3) | kLengthDelimited) +
         CodedOutputStream::VarintSize32(static_cast<std::uint32_t>(length));
}

/// Begins in `out` a frame with an ExperimentData of so many bytes. The caller reads the file into the
/// returned span, which saves a copy.
std::span<std::byte> begin_data_frame(std::vector<std::byte>& out, std::uint64_t request, std::uint64_t id,
                                      std::uint64_t first, std::size_t bytes) {
  v1::Envelope envelope;
  envelope.set_id(request);
  v1::ExperimentData data;
  data.set_id(id);
  data.set_first(first);
  const std::string outer = envelope.SerializeAsString();
  const std::string inner = data.SerializeAsString();
  const std::size_t message = inner.size() + tag_size(v1::ExperimentData::kDataFieldNumber, bytes) + bytes;
  const std::size_t payload =
      outer.size() + tag_size(v1::Envelope::kExperimentDataFieldNumber, message) + message;
  out.resize(kFrameHeaderSize + payload);
  const auto header = frame_header(static_cast<std::uint32_t>(payload));
  std::copy(header.begin(), header.end(), out.begin());
  auto* at = reinterpret_cast<std::uint8_t*>(out.data()) + kFrameHeaderSize;
  at = std::copy(outer.begin(), outer.end(), at);
  at = put_tag(v1::Envelope::kExperimentDataFieldNumber, static_cast<std::uint32_t>(message), at);
  at = std::copy(inner.begin(), inner.end(), at);
  put_tag(v1::ExperimentData::kDataFieldNumber, static_cast<std::uint32_t>(bytes), at);
  return std::span(out).last(bytes);
}

}  // namespace

void Fetch::begin(const v1::FetchExperiment& r) {
  with_experiments(dialogue_, [&](Experiments& experiments) { start(experiments, r); });
}

void Fetch::start(Experiments& experiments, const v1::FetchExperiment& r) {
  if (under_way_) throw BadRequest(v1::REFUSAL_BUSY, "id", "this session is fetching already");
  const std::shared_ptr<const Experiment> experiment = experiments.find(r.id(), r.owner());
  const v1::ExperimentInfo info = experiments.info_of(*experiment);
  if (r.recording() && !Experiments::has_ended(info.state())) {
    throw BadRequest(v1::REFUSAL_BUSY, "recording", "the recording is not there before the experiment ends");
  }
  const std::uint64_t step = r.recording() ? 1 : info.decimation();
  const std::uint64_t most = r.recording() ? info.recording_bytes() : info.ticks() + step;
  if (r.from() % step != 0 || r.from() > most) {
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "from",
                     fmt::format("from is {} but must be a multiple of {} up to {}", r.from(), step, most));
  }
  Outbox::Socket& socket = dialogue_.socket();
  boost::system::error_code ignored;
  asio::socket_base::send_buffer_size size;
  socket.get_option(size, ignored);
  under_way_ = UnderWay{.id = dialogue_.id(),
                        .experiment = experiment,
                        .recording = r.recording(),
                        .next = r.from() / step,
                        .row_bytes = r.recording() ? 1 : 8 * static_cast<std::size_t>(info.signals_size()),
                        .file = nullptr,
                        .last_info = ServerClock::now(),
                        .send_buffer_bytes = size.value() / 2};  // Linux reports twice the requested size
  socket.set_option(asio::socket_base::send_buffer_size(kFetchBufferBytes), ignored);
  send_info(dialogue_, dialogue_.id(), *experiment);
  go_on();
}

void Fetch::go_on() {
  std::size_t budget = kTurnBytes;
  try {
    while (under_way_ && dialogue_.outbox().idle() && dialogue_.socket().is_open() && send_some(budget)) {
    }
  } catch (const std::exception& error) {
    const std::uint64_t id = under_way_->id;
    end();
    dialogue_.refuse(id, v1::REFUSAL_NOT_AVAILABLE, error.what(), "id");
  }
}

void Fetch::end() {
  boost::system::error_code ignored;
  dialogue_.socket().set_option(asio::socket_base::send_buffer_size(under_way_->send_buffer_bytes), ignored);
  under_way_.reset();
}

/// Sends one message; false if no more can be sent now.
bool Fetch::send_some(std::size_t& budget) {
  const v1::ExperimentInfo info = dialogue_.context().experiments->info_of(*under_way_->experiment);
  const std::uint64_t there = under_way_->recording ? info.recording_bytes() : info.rows();
  if (under_way_->next >= there) {
    send_state(info);
    return false;
  }
  if (budget < kChunkBytes) {
    asio::post(dialogue_.socket().get_executor(), [this, session = dialogue_.keep_alive()] { go_on(); });
    return false;
  }
  budget -= kChunkBytes;
  send_rows(info, there);
  return true;
}

void Fetch::send_rows(const v1::ExperimentInfo& info, std::uint64_t there) {
  UnderWay& f = *under_way_;
  if (f.file == nullptr) {
    const Experiments& experiments = *dialogue_.context().experiments;
    f.file = std::make_unique<FileReader>(f.recording ? experiments.recording_file(f.experiment->id)
                                                      : experiments.rows_file(f.experiment->id));
  }
  const std::uint64_t count = std::min<std::uint64_t>(there - f.next, kChunkBytes / f.row_bytes);
  const std::uint64_t step = f.recording ? 1 : info.decimation();
  const std::span<std::byte> data =
      begin_data_frame(dialogue_.scratch(), f.id, f.experiment->id, f.next * step, count * f.row_bytes);
  f.file->read(f.next * f.row_bytes, data);
  f.next += count;
  dialogue_.send_scratch();
}

/// After all present data: sends the state of the experiment at intervals, and at its end.
void Fetch::send_state(const v1::ExperimentInfo& info) {
  UnderWay& f = *under_way_;
  const auto now = ServerClock::now();
  const bool ended = Experiments::has_ended(info.state());
  if (!ended && now - f.last_info < kInfoInterval) return;
  f.last_info = now;
  const std::uint64_t id = f.id;
  const std::shared_ptr<const Experiment> experiment = f.experiment;
  if (ended) end();
  send_info(dialogue_, id, *experiment);
}

}  // namespace drivebench
