// What a session does about experiments.
#include <fmt/format.h>
#include <google/protobuf/io/coded_stream.h>

#include <array>
#include <cmath>

#include "server/endpoints/tcp/session.hpp"

namespace drivebench {
namespace {

using google::protobuf::io::CodedOutputStream;

/// Of rows or of the recording in one message; small enough that a client's memory comes from its heap.
constexpr std::size_t kChunkBytes = std::size_t{64} * 1024;
/// What a session sends before others have their turn.
constexpr std::size_t kTurnBytes = 8 * kChunkBytes;
/// What the kernel keeps on its way to a fetching client, if it is allowed to: while this is read the next is
/// made.
constexpr int kFetchBufferBytes = 512 * 1024;
constexpr auto kInfoInterval = std::chrono::milliseconds(200);
constexpr std::size_t kMaxTables = 64;
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

/// Makes `out` a frame with an ExperimentData of so many bytes, which go into the span that comes back:
/// they are copied once, from the file.
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

/// The rows of a message, which come after this time. Throws BadRequest.
std::vector<SignalTable::Row> rows_of(const v1::UploadTable& r, double last_s) {
  std::vector<SignalTable::Row> rows;
  rows.reserve(static_cast<std::size_t>(r.times_s_size()));
  for (int i = 0; i < r.times_s_size(); ++i) {
    const std::uint64_t number = r.first() + static_cast<std::uint64_t>(i);
    if (!std::isfinite(r.times_s(i)) || r.times_s(i) <= last_s || r.times_s(i) < 0.0) {
      throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, fmt::format("times_s[{}]", i),
                       fmt::format("the time {} of row {} must be finite, not negative and later than that "
                                   "before it",
                                   r.times_s(i), number));
    }
    if (!(std::abs(r.values(i)) <= kMaxInputValue)) {
      throw BadRequest(
          v1::REFUSAL_OUT_OF_RANGE, fmt::format("values[{}]", i),
          fmt::format("the value {} of row {} must lie between -1e6 and 1e6", r.values(i), number));
    }
    last_s = r.times_s(i);
    rows.push_back({.time_s = r.times_s(i), .value = r.values(i)});
  }
  return rows;
}

}  // namespace

template <class Action>
void Session::with_experiments(Action action) {
  const std::uint64_t id = request_.id();
  if (context_.experiments == nullptr) {
    return refuse(id, v1::REFUSAL_NOT_AVAILABLE,
                  "this bench keeps no experiments: its configuration has no [experiments]", "experiments");
  }
  try {
    action(*context_.experiments);
  } catch (const BadRequest& bad) {
    refuse(id, bad.code(), bad.what(), bad.field().c_str());
  } catch (const std::exception& error) {
    refuse(id, v1::REFUSAL_NOT_AVAILABLE, error.what(), "experiments");
  }
}

void Session::run_experiment(const v1::RunExperiment& r) {
  with_experiments([&](Experiments& experiments) {
    const auto table = [this](std::uint64_t number) -> std::shared_ptr<const SignalTable> {
      const auto found = tables_.find(number);
      return found == tables_.end() ? nullptr : found->second;
    };
    experiments.submit(r, table,
                       [self = shared_from_this(), id = request_.id()](
                           const std::shared_ptr<const Experiment>& experiment, const std::string& why_not) {
                         if (experiment == nullptr) {
                           return self->refuse(id, v1::REFUSAL_NOT_AVAILABLE, why_not, "experiments");
                         }
                         const v1::RunExperiment& wanted = experiment->request;
                         self->audit(
                             "experiment", "done",
                             {{"id", experiment->id}, {"user", wanted.user()}, {"label", wanted.label()}});
                         self->send_info(id, *experiment);
                       });
  });
}

void Session::send_info(std::uint64_t id, const Experiment& experiment) {
  reply_.Clear();
  reply_.set_id(id);
  *reply_.mutable_experiment_info() = context_.experiments->info_of(experiment);
  send(reply_);
}

void Session::upload_table(const v1::UploadTable& r) {
  with_experiments([&](Experiments& experiments) {
    if (r.times_s_size() != r.values_size()) {
      throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "values",
                       fmt::format("there are {} times but {} values", r.times_s_size(), r.values_size()));
    }
    if (r.table() != 0 && !tables_.contains(r.table())) {
      throw BadRequest(v1::REFUSAL_UNKNOWN_TABLE, "table",
                       fmt::format("this session has no table {}", r.table()));
    }
    if (r.table() == 0 && tables_.size() >= kMaxTables) {
      throw BadRequest(v1::REFUSAL_BUSY, "table",
                       fmt::format("this session has {} tables, as many as may be", kMaxTables));
    }
    const std::shared_ptr<SignalTable> table =
        r.table() == 0 ? experiments.new_table() : tables_.at(r.table());
    if (r.first() != table->size()) {
      throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "first",
                       fmt::format("first is {} but must be {}, the next row", r.first(), table->size()));
    }
    std::uint64_t rows = static_cast<std::uint64_t>(r.times_s_size());
    experiments.check_rows(rows);
    for (const auto& [number, other] : tables_)
      rows += other->size();
    if (rows > experiments.max_table_rows()) {
      throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "times_s",
                       fmt::format("the tables of this session come to {} rows but may have {}", rows,
                                   experiments.max_table_rows()));
    }
    table->append(rows_of(r, table->size() == 0 ? -1.0 : table->last_time_s()));
    const std::uint64_t number = r.table() == 0 ? ++last_table_ : r.table();
    tables_[number] = table;
    reply_.Clear();
    reply_.set_id(request_.id());
    reply_.mutable_table_info()->set_table(number);
    reply_.mutable_table_info()->set_rows(table->size());
    send(reply_);
  });
}

void Session::list_experiments(const v1::ListExperiments& r) {
  with_experiments([&](Experiments& experiments) {
    reply_.Clear();
    reply_.set_id(request_.id());
    *reply_.mutable_experiment_list() = experiments.list(r.owner());
    send(reply_);
  });
}

void Session::cancel_experiment(const v1::CancelExperiment& r) {
  with_experiments([&](Experiments& experiments) {
    const std::shared_ptr<const Experiment> experiment = experiments.cancel(r.id(), r.owner());
    audit("experiment_cancelled", "done", {{"id", r.id()}});
    send_info(request_.id(), *experiment);
  });
}

void Session::fetch_experiment(const v1::FetchExperiment& r) {
  with_experiments([&](Experiments& experiments) {
    if (fetch_) throw BadRequest(v1::REFUSAL_BUSY, "id", "this session is fetching already");
    const std::shared_ptr<const Experiment> experiment = experiments.find(r.id(), r.owner());
    const v1::ExperimentInfo info = experiments.info_of(*experiment);
    if (r.recording() && !Experiments::has_ended(info.state())) {
      throw BadRequest(v1::REFUSAL_BUSY, "recording",
                       "the recording is not there before the experiment ends");
    }
    const std::uint64_t step = r.recording() ? 1 : info.decimation();
    const std::uint64_t most = r.recording() ? info.recording_bytes() : info.ticks() + step;
    if (r.from() % step != 0 || r.from() > most) {
      throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "from",
                       fmt::format("from is {} but must be a multiple of {} up to {}", r.from(), step, most));
    }
    fetch_ = Fetch{.id = request_.id(),
                   .experiment = experiment,
                   .recording = r.recording(),
                   .next = r.from() / step,
                   .row_bytes = r.recording() ? 1 : 8 * static_cast<std::size_t>(info.signals_size()),
                   .file = nullptr,
                   .last_info = ServerClock::now(),
                   .send_buffer_bytes = 0};
    boost::system::error_code ignored;
    asio::socket_base::send_buffer_size size;
    socket_.get_option(size, ignored);
    fetch_->send_buffer_bytes = size.value() / 2;  // Linux tells twice what was asked for
    socket_.set_option(asio::socket_base::send_buffer_size(kFetchBufferBytes), ignored);
    send_info(request_.id(), *experiment);
    send_experiment();
  });
}

void Session::on_experiments() {
  send_experiment();
}

/// Sends what there is as far as the socket takes it; a slow reader is served when it has room again.
void Session::send_experiment() {
  std::size_t budget = kTurnBytes;
  try {
    while (fetch_ && outbox_.idle() && socket_.is_open() && send_rows(budget)) {
    }
  } catch (const std::exception& error) {
    const std::uint64_t id = fetch_->id;
    end_fetch();
    refuse(id, v1::REFUSAL_NOT_AVAILABLE, error.what(), "id");
  }
}

void Session::end_fetch() {
  boost::system::error_code ignored;
  socket_.set_option(asio::socket_base::send_buffer_size(fetch_->send_buffer_bytes), ignored);
  fetch_.reset();
}

/// One message; false when there is nothing to send now.
bool Session::send_rows(std::size_t& budget) {
  Fetch& f = *fetch_;
  const v1::ExperimentInfo info = context_.experiments->info_of(*f.experiment);
  const std::uint64_t there = f.recording ? info.recording_bytes() : info.rows();
  if (f.next < there) {
    if (budget < kChunkBytes) {
      asio::post(socket_.get_executor(), [self = shared_from_this()] { self->send_experiment(); });
      return false;
    }
    budget -= kChunkBytes;
    if (f.file == nullptr) {
      f.file =
          std::make_unique<FileReader>(f.recording ? context_.experiments->recording_file(f.experiment->id)
                                                   : context_.experiments->rows_file(f.experiment->id));
    }
    const std::uint64_t count = std::min<std::uint64_t>(there - f.next, kChunkBytes / f.row_bytes);
    const std::uint64_t step = f.recording ? 1 : info.decimation();
    const std::span<std::byte> data =
        begin_data_frame(scratch_, f.id, f.experiment->id, f.next * step, count * f.row_bytes);
    f.file->read(f.next * f.row_bytes, data);
    f.next += count;
    outbox_.send(scratch_, shared_from_this());
    return true;
  }
  const auto now = ServerClock::now();
  const bool ended = Experiments::has_ended(info.state());
  if (!ended && now - f.last_info < kInfoInterval) return false;
  f.last_info = now;
  const std::uint64_t id = f.id;
  const std::shared_ptr<const Experiment> experiment = f.experiment;
  if (ended) end_fetch();
  send_info(id, *experiment);
  return false;
}

}  // namespace drivebench
