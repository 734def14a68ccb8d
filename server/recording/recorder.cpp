#include "server/recording/recorder.hpp"

#include <pthread.h>

#include <algorithm>
#include <chrono>

#include "server/recording/recording_writer.hpp"

namespace drivebench {
namespace {

constexpr auto kIdleSleep = std::chrono::milliseconds(1);

constexpr std::size_t kMaxQueueBytes = std::size_t{256} << 20;
/// Four blocks are left for those that the queue has beyond its capacity, and for its lists.
constexpr std::size_t kMaxQueueEntries =
    kMaxQueueBytes / sizeof(RecordedEntry) - 4 * SpscQueue<RecordedEntry>::kBlockEntries;

/// The most entries between two reads of the clock.
constexpr std::size_t kEntriesPerLook = 4096;

/// The most inputs between two checks for room: in a free run the 256 requests and commands of a tick, in
/// lockstep an exchange, a command and an end of the lease for each axis; and the events that a trigger lets
/// go.
constexpr std::size_t kInputsPerLook = 576;
static_assert(kInputsPerLook >= 256 + 3 * kMaxAxes + kMaxAxisEvents);

}  // namespace

std::size_t recorder_queue_entries(const BenchConfig& config) noexcept {
  const double ticks = 2e9 / static_cast<double>(config.setup.period_ns);
  const auto entries = static_cast<std::size_t>(2.0 * ticks * static_cast<double>(config.axes.size())) + 1024;
  return std::min(entries, kMaxQueueEntries);
}

Recorder::Recorder(const std::filesystem::path& file, const BenchConfig& config,
                   std::initializer_list<RecordingAttachment> attachments, const RecordingOptions& options)
    // Without real time a tick may wait for a page, and a short run needs few of them.
    : queue_(recorder_queue_entries(config),
             config.mode == RunMode::kRealtime ? Pages::kTouched : Pages::kUntouched),
      room_for_tick_(config.axes.size() + kInputsPerLook),
      writer_(std::make_unique<RecordingWriter>(file, config, attachments, options)) {
  tell_state();
  if (options.own_thread) thread_ = std::thread([this] { run(); });
}

Recorder::~Recorder() {
  stop_.store(true);
  if (thread_.joinable()) thread_.join();
}

void Recorder::on_input(Tick now, const Input& input) noexcept {
  count_gap(!queue_.emplace(std::in_place_type<ReceivedInput>, now, input));
}

void Recorder::on_sample(std::uint32_t axis, const Sample& sample) noexcept {
  if (new_base_) offer_time_base();
  count_gap(!queue_.emplace(std::in_place_type<TickedSample>, axis, sample));
}

void Recorder::offer_time_base() noexcept {
  if (queue_.emplace(std::in_place_type<TimeBase>, *new_base_)) new_base_.reset();
}

void Recorder::count_gap(bool lost) noexcept {
  if (lost) gaps_.fetch_add(1, std::memory_order_relaxed);
}

void Recorder::wait_for_room() noexcept {
  while (!has_room()) {
    if (!thread_.joinable()) {
      work();
    } else {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
  }
}

bool Recorder::drain(std::size_t most) noexcept {
  std::size_t taken = 0;
  for (const RecordedEntry* entry = nullptr; taken < most && (entry = queue_.front()) != nullptr; ++taken) {
    writer_->write(*entry);
    queue_.pop();
  }
  return taken > 0;
}

void Recorder::run() {
  pthread_setname_np(pthread_self(), "recorder");
  while (!stop_.load())
    if (!work()) std::this_thread::sleep_for(kIdleSleep);
}

bool Recorder::work() noexcept {
  const bool any = drain(kEntriesPerLook);
  writer_->sync_if_due(RecordingWriter::Clock::now());
  tell_state();
  return any;
}

/// Publishes the state of the writer. Called on the writer's thread.
void Recorder::tell_state() noexcept {
  gaps_.fetch_add(writer_->take_lost(), std::memory_order_relaxed);
  lacks_room_.store(writer_->lacks_room(), std::memory_order_relaxed);
  is_over_.store(writer_->is_over(), std::memory_order_relaxed);
  const std::lock_guard lock(mutex_);
  file_ = writer_->file();
  remarks_ = writer_->remarks();
}

std::string Recorder::file() const {
  const std::lock_guard lock(mutex_);
  return file_;
}

std::string Recorder::remarks() const {
  const std::lock_guard lock(mutex_);
  return remarks_;
}

Verdict Recorder::finish(const Verdict& verdict) {
  stop_.store(true);
  if (thread_.joinable()) thread_.join();
  drain(queue_.capacity());
  tell_state();
  Verdict final_verdict = verdict;
  final_verdict.gaps = gaps();
  final_verdict.recording = file();
  final_verdict.remarks = remarks();
  writer_->finish(final_verdict);
  tell_state();
  final_verdict.gaps = gaps();
  final_verdict.recording = file();
  final_verdict.remarks = remarks();
  return final_verdict;
}

}  // namespace drivebench
