#include "server/endpoints/tcp/session/shared_memory/shared_exchanges.hpp"

#include <sched.h>

#include <atomic>
#include <cerrno>
#include <exception>
#include <system_error>
#include <utility>

#include "server/config/config.hpp"

namespace drivebench {
namespace {

static_assert(kMaxAxes <= shm::kMaxAxes);

/// Copies a text with a zero behind it; the end of one that is too long is lost.
template <std::size_t n>
void copy_text(std::array<char, n>& to, std::string_view from) noexcept {
  const std::size_t size = from.copy(to.data(), n - 1);
  to[size] = '\0';
}

}  // namespace

SharedExchanges::SharedExchanges(Dialogue& dialogue, Exchanges& exchanges)
    : dialogue_(dialogue),
      exchanges_(exchanges),
      pause_(dialogue.socket().get_executor()),
      bell_(dialogue.socket().get_executor()) {}

void SharedExchanges::share(const v1::ShareMemory& r) {
  if (!may_share(r)) return;
  try {
    segment_.emplace(dialogue_.axis_count());
    bell_.assign(asio::local::stream_protocol(), segment_->take_bell());
    send_reply();
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

bool SharedExchanges::may_share(const v1::ShareMemory& r) {
  const auto refuse = [this](v1::RefusalCode code, const std::string& sentence, const char* field) {
    dialogue_.refuse(dialogue_.id(), code, sentence, field);
    return false;
  };
  if (dialogue_.client().transport != "unix") {
    return refuse(v1::REFUSAL_NOT_AVAILABLE,
                  "memory is shared over the unix socket of the bench only (shm:PATH), not over " +
                      dialogue_.client().transport,
                  "kind");
  }
  if (r.spin_us() > shm::kMaxSpinUs) {
    return refuse(
        v1::REFUSAL_OUT_OF_RANGE,
        "spin_us is " + std::to_string(r.spin_us()) + " but must be 0 to " + std::to_string(shm::kMaxSpinUs),
        "spin_us");
  }
  if (segment_) return refuse(v1::REFUSAL_BUSY, "this session shares memory already", "kind");
  if (!dialogue_.outbox().idle()) {
    return refuse(v1::REFUSAL_BUSY, "the session has not read its earlier answers; then ask again", "kind");
  }
  return true;
}

/// Sends the answer and the descriptors.
void SharedExchanges::send_reply() {
  dialogue_.begin_reply(dialogue_.id()).mutable_shared_memory()->set_bytes(segment_->bytes());
  std::vector<std::byte>& bytes = dialogue_.encode_reply();
  const std::ptrdiff_t sent =
      segment_->send_with(dialogue_.socket().native_handle(), bytes.data(), bytes.size());
  if (sent < 0) throw std::system_error(errno, std::generic_category(), "the socket takes no descriptors");
  bytes.erase(bytes.begin(), bytes.begin() + sent);
  if (!bytes.empty()) dialogue_.send_scratch();
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
  if (count > shm::kMaxAxes) {
    return refuse(number, v1::REFUSAL_OUT_OF_RANGE,
                  std::to_string(count) + " commands, but there are at most " + std::to_string(shm::kMaxAxes),
                  "commands");
  }
  // A copy: the client might change them meanwhile.
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
  copy_text(reply.sentence, sentence);
  copy_text(reply.field, field);
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
