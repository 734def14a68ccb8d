#include "server/endpoints/tcp/session/shared_memory/shared_exchanges.hpp"

#include <sched.h>

#include <atomic>
#include <exception>
#include <utility>

#include "protocols/shm/fixed_text.hpp"
#include "server/config/config.hpp"
#include "server/endpoints/tcp/session/shared_memory/sharing.hpp"

namespace drivebench {
namespace {

static_assert(kMaxAxes <= shm::kMaxAxes);

}  // namespace

SharedExchanges::SharedExchanges(Dialogue& dialogue, Exchanges& exchanges)
    : dialogue_(dialogue),
      exchanges_(exchanges),
      pause_(dialogue.socket().get_executor()),
      bell_(dialogue.socket().get_executor()) {}

void SharedExchanges::share(const v1::ShareMemory& r) {
  if (!may_share(dialogue_, r.spin_us(), segment_.has_value())) return;
  try {
    segment_.emplace(dialogue_.axis_count());
    bell_.assign(asio::local::stream_protocol(), segment_->take_bell());
    answer_with_memory(dialogue_, segment_->bytes(), [this](std::span<const std::byte> bytes) {
      return segment_->send_with(dialogue_.socket().native_handle(), bytes);
    });
  } catch (const std::exception& error) {
    segment_.reset();
    boost::system::error_code ignored;
    bell_.close(ignored);
    return dialogue_.refuse(dialogue_.id(), v1::REFUSAL_BUSY, error.what(), "kind");
  }
  spin_ = std::chrono::microseconds(r.spin_us());
  commands_.reserve(shm::kMaxAxes);
  expect();
}

void SharedExchanges::close() {
  if (!segment_ || std::exchange(is_over_, true)) return;
  dialogue_.context().spinner.leave(*this);
  pause_.cancel();
  boost::system::error_code ignored;
  bell_.close(ignored);
  segment_->forget();
  segment_->wake_client();  // its socket shows the end
}

bool SharedExchanges::look(Spinner::Clock::time_point now) {
  if (is_over_ || waits_for_tick_ || rests_) return false;
  try {
    if (serve()) {
      asked_ = now;
      return !is_over_ && !waits_for_tick_ && !rests_;
    }
  } catch (const std::exception& error) {  // ends this session and nothing else
    is_serving_ = false;
    dialogue_.outbox().cut(error.what());
    return false;
  }
  return (now - asked_ < spin_ && client_has_own_cpu()) || !fall_asleep();
}

/// On one CPU the client cannot go on while the bench spins.
bool SharedExchanges::client_has_own_cpu() {
  return segment_->request().cpu != segment_->reply().cpu;
}

/// Whether there was an exchange.
bool SharedExchanges::serve() {
  const std::uint32_t number = segment_->request().number.load();
  if (number == number_) return false;
  segment_->reply().asleep.store(0);
  const bool is_next = number == number_ + 1;
  number_ = number;
  is_serving_ = true;
  waits_for_tick_ = true;
  if (is_next) {
    exchange(number);
  } else {
    exchanges_.excess().charge();
    refuse(number, v1::REFUSAL_MALFORMED, "the number of an exchange is not that of the last one and 1 more",
           "number");
  }
  is_serving_ = false;
  if (const auto pause = exchanges_.excess().pause(); pause > pause.zero()) rest(pause);
  return true;
}

void SharedExchanges::exchange(std::uint32_t number) {
  const shm::Request& request = segment_->request();
  const std::uint64_t count = request.count;
  std::atomic_signal_fence(std::memory_order_seq_cst);  // read once: the client might change it meanwhile
  if (count > shm::kMaxAxes) {
    return refuse(number, v1::REFUSAL_OUT_OF_RANGE,
                  std::to_string(count) + " commands, but there are at most " + std::to_string(shm::kMaxAxes),
                  "commands");
  }
  // A copy: the client might change these, too.
  commands_.assign(request.commands.begin(), request.commands.begin() + static_cast<std::ptrdiff_t>(count));
  std::atomic_signal_fence(std::memory_order_seq_cst);
  exchanges_.exchange(commands_, *this, number);
}

void SharedExchanges::answer(std::uint64_t id, std::span<const AxisSampleView> samples) {
  shm::SampleRecord* to = segment_->samples();
  for (const AxisSampleView& view : samples)
    *to++ = {.axis = view.axis, .sample = *view.sample};
  segment_->reply().count = samples.size();
  segment_->reply().code = 0;
  publish(id);
}

void SharedExchanges::refuse(std::uint64_t id, v1::RefusalCode code, const std::string& sentence,
                             const char* field) {
  shm::Reply& reply = segment_->reply();
  shm::put_text(reply.sentence, sentence);
  shm::put_text(reply.field, field);
  reply.count = 0;
  reply.code = static_cast<std::uint64_t>(code);
  publish(id);
}

void SharedExchanges::publish(std::uint64_t id) {
  segment_->reply().cpu = ::sched_getcpu();
  segment_->reply().number.store(static_cast<std::uint32_t>(id));
  if (segment_->request().waits.load() != 0) segment_->wake_client();
  waits_for_tick_ = false;
  if (!is_serving_ && !is_over_) expect();
}

void SharedExchanges::expect() {
  asked_ = Spinner::Clock::now();
  dialogue_.context().spinner.watch(*this);
}

/// False: there is an exchange to serve first.
bool SharedExchanges::fall_asleep() {
  if (!std::exchange(waits_for_bell_, true)) {
    bell_.async_read_some(asio::buffer(rings_), [this, self = dialogue_.keep_alive()](
                                                    const boost::system::error_code& error, std::size_t) {
      waits_for_bell_ = false;
      // Looks once: a ring without an exchange gives no right to be looked at for longer.
      if (!error && !is_over_) dialogue_.context().spinner.watch(*this);
    });
  }
  segment_->reply().asleep.store(1);
  return segment_->request().number.load() == number_;
}

/// Does not look for a while.
void SharedExchanges::rest(ServerClock::duration pause) {
  rests_ = true;
  pause_.expires_after(pause);
  pause_.async_wait([this, self = dialogue_.keep_alive()](const boost::system::error_code& error) {
    rests_ = false;
    if (!error && !is_over_) expect();
  });
}

}  // namespace drivebench
