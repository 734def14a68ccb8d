#include "server/endpoints/modbus/connection.hpp"

#include <poll.h>

#include <algorithm>
#include <string_view>

#include "server/endpoints/lost_peer.hpp"
#include "server/host/logging/log.hpp"

namespace drivebench::modbus {
namespace {

// Answers go out together while requests wait, up to this size.
constexpr std::size_t kMaxQueued = 8 * kMaxAdu;
// An accepted command gives back the tokens for itself and for the read of its sample: a tick takes at most
// one.
constexpr double kPaidByCommand = 2.0;

std::string name_of(const asio::ip::tcp::endpoint& peer) {
  return "modbus " + peer.address().to_string() + ":" + std::to_string(peer.port());
}

}  // namespace

ClientConnection::ClientConnection(asio::ip::tcp::socket socket, Visitor number, Shared& shared)
    : socket_(std::move(socket)),
      number_(number),
      shared_(shared),
      waker_(socket_.get_executor()),
      timer_(socket_.get_executor()) {
  boost::system::error_code gone;
  const asio::ip::tcp::endpoint peer = socket_.remote_endpoint(gone);
  peer_ = peer.address();
  name_ = gone ? "modbus peer" : name_of(peer);
  socket_.non_blocking(true, gone);
}

void ClientConnection::close() noexcept {
  open_ = false;
  boost::system::error_code ignored;
  socket_.shutdown(asio::ip::tcp::socket::shutdown_both, ignored);
  socket_.close(ignored);
  waker_.cancel();
}

void ClientConnection::cut(std::string_view why) {
  ++shared_.counts.cut;
  if (shared_.cut_log.allow()) {
    log::warn("{}: cut off: {} ({} more since the last such line)", name_, why, shared_.cut_log.held_back());
  }
  audit("limit", why);
  close();
}

void ClientConnection::note_loss(const boost::system::error_code& error) {
  // The kernel ends a connection whose peer acknowledges nothing, often before the timer here has begun.
  if (open_ && is_given_up(error)) cut("it took nothing for too long");
}

void ClientConnection::audit(std::string_view event, std::string_view why_not,
                             std::optional<std::uint32_t> axis) const {
  if (shared_.audit == nullptr) return;
  const drivebench::Client client{.transport = "modbus", .peer = peer_name(), .subject = {}};
  shared_.audit->note({.name = event, .axis = axis, .client = &client, .result = why_not});
}

bool ClientConnection::has_lease() const noexcept {
  return std::any_of(shared_.desks.begin(), shared_.desks.end(),
                     [this](const auto& desk) { return desk->holds(number_); });
}

void ClientConnection::start_timer() {
  if (timing_) return;
  timing_ = true;
  timer_.set(std::chrono::milliseconds(shared_.engine.config().modbus.frame_timeout_ms),
             [self = shared_from_this()] {
               if (self->open_) self->cut("a frame took too long");
             });
}

asio::awaitable<void> ClientConnection::run() {
  const std::shared_ptr<ClientConnection> self = shared_from_this();
  boost::system::error_code error;
  while (open_) {
    const std::span<std::uint8_t> space = reader_.free_space();
    const std::size_t count = co_await socket_.async_read_some(
        asio::buffer(space.data(), space.size()), asio::redirect_error(asio::use_awaitable, error));
    if (error) {
      note_loss(error);
      break;
    }
    reader_.received(count);
    while (open_) {
      const auto adu = reader_.next();
      if (!adu) break;
      stop_timer();
      const bool go_on = co_await answer(*adu);
      if (!go_on) open_ = false;
      if (out_.size() > kMaxQueued) {
        const bool sent = co_await flush();
        if (!sent) open_ = false;
      }
    }
    const bool sent = co_await flush();
    if (!sent) break;
    if (!reader_.error().empty()) cut(reader_.error());
    if (reader_.in_frame()) start_timer();
  }
  stop_timer();
}

void ClientConnection::end() {
  for (const auto& desk : shared_.desks)
    desk->connection_ended(number_);
  close();
}

/// Sends the queued answers. Most often the kernel takes them at once.
asio::awaitable<bool> ClientConnection::flush() {
  boost::system::error_code error;
  std::size_t sent = 0;
  while (sent < out_.size() && !error && socket_.is_open()) {
    const auto rest = asio::buffer(out_.data() + sent, out_.size() - sent);
    sent += socket_.write_some(rest, error);
    if (error != asio::error::would_block) continue;
    start_timer();  // for a peer that takes nothing
    co_await socket_.async_wait(asio::ip::tcp::socket::wait_write,
                                asio::redirect_error(asio::use_awaitable, error));
    stop_timer();
  }
  out_.clear();
  if (error) note_loss(error);
  co_return !error;
}

AxisDesk* ClientConnection::desk_of(std::uint8_t unit) {
  const std::size_t axis = unit == 0 || unit == 255 ? 0 : unit - 1u;
  return axis < shared_.desks.size() ? shared_.desks[axis].get() : nullptr;
}

void ClientConnection::reply(Bytes adu, Bytes pdu) {
  const std::size_t length = pdu.size() + 1;
  out_.insert(out_.end(), adu.begin(), adu.begin() + 4);
  out_.push_back(static_cast<std::uint8_t>(length >> 8));
  out_.push_back(static_cast<std::uint8_t>(length & 0xff));
  out_.push_back(adu[6]);
  out_.insert(out_.end(), pdu.begin(), pdu.end());
}

void ClientConnection::refuse(Bytes adu, Exception exception) {
  ++shared_.counts.exceptions;
  const std::array<std::uint8_t, 2> pdu{static_cast<std::uint8_t>(adu[kMbapSize] | 0x80),
                                        static_cast<std::uint8_t>(exception)};
  reply(adu, pdu);
}

/// False: the connection ends once the queued answers are sent.
asio::awaitable<bool> ClientConnection::answer(Bytes adu) {
  ++shared_.counts.requests;
  last_request_ = Clock::now();
  const RateLimit::Answer rate = shared_.rate.charge(peer_, last_request_);
  if (rate == RateLimit::Answer::kCut) {
    co_await flush();
    cut("too many requests");
    co_return false;
  }
  if (rate == RateLimit::Answer::kRefuse) {
    if (shared_.counts.throttled++ % 1000 == 0) audit("limit", "too many requests: refused");
    refuse(adu, Exception::kBusy);
    co_return true;
  }
  AxisDesk* const desk = desk_of(adu[6]);
  // Without a desk any map will do: it serves only to check the form of the frame.
  const PduCheck check =
      validate(adu.subspan(kMbapSize), desk != nullptr ? desk->map() : shared_.desks.front()->map());
  if (check.action == PduCheck::Action::kClose) {
    co_await flush();
    cut("a frame has the wrong length for its function");
    co_return false;
  }
  if (desk == nullptr) {
    refuse(adu, Exception::kNoTarget);
    co_return true;
  }
  desk->spoke(number_);
  if (check.action == PduCheck::Action::kRefuse) {
    if (check.request.write.count > 0) {
      words_ = words_from(check.request.data);
      desk->count_refused(check.request.write, words_, number_);
      note_refused_write(*desk, Refused::kOutOfRange);
    }
    refuse(adu, check.exception);
    co_return true;
  }
  co_await execute(*desk, adu, check.request);
  co_return true;
}

asio::awaitable<void> ClientConnection::execute(AxisDesk& desk, Bytes adu, Request request) {
  const Bytes pdu = adu.subspan(kMbapSize);
  if (request.function == Function::kDiagnostics) {
    reply(adu, pdu);
    co_return;
  }
  if (request.function == Function::kEncapsulated) {
    const std::vector<std::uint8_t> objects = shared_.identification.answer(pdu);
    objects.empty() ? refuse(adu, Exception::kIllegalAddress) : reply(adu, objects);
    co_return;
  }
  if (writes(request.function)) {
    const Exception exception = co_await carry_out_write(desk, request);
    if (exception != Exception::kNone) {
      refuse(adu, exception);
      co_return;
    }
  }
  fill_reply(desk, request);
  const Bytes answer = shared_.replies.reply(adu);
  answer.empty() ? refuse(adu, Exception::kFailure)
                 : static_cast<void>(out_.insert(out_.end(), answer.begin(), answer.end()));
}

/// Writes the registers and bits that libmodbus is going to read.
void ClientConnection::fill_reply(AxisDesk& desk, const Request& request) {
  const std::size_t from = request.read_address;
  for (std::size_t i = from; i < from + request.read_count; ++i) {
    if (request.function == Function::kReadCoils) shared_.replies.coils()[i] = desk.coil(i, number_) ? 1 : 0;
    if (request.function == Function::kReadDiscreteInputs) {
      shared_.replies.discrete_inputs()[i] = desk.discrete_input(i) ? 1 : 0;
    }
  }
  if (request.read.count > 0) {
    desk.read(request.read, number_, shared_.replies.registers().subspan(from, request.read_count));
  }
}

asio::awaitable<Exception> ClientConnection::carry_out_write(AxisDesk& desk, const Request& request) {
  const bool is_process = request.write.count > 0 && request.write.first < kCommandStart;
  const bool runs_by_itself = shared_.engine.config().mode != RunMode::kLockstep;
  if (is_process && runs_by_itself && desk.has_answered_tick(number_))
    co_await wait_for_tick(desk, shared_.engine.tick());
  const Tick before = shared_.engine.tick();
  AxisDesk::Outcome outcome;
  if (request.write.count == 0) {
    outcome = co_await desk.write_coils(request.write_address, request.write_count, request.data[0], number_);
  } else {
    words_ = words_from(request.data);
    if (request.function == Function::kMaskWriteRegister) {
      std::uint16_t now = 0;
      desk.read(request.write, number_, {&now, 1});
      words_[0] = static_cast<std::uint16_t>((now & words_[0]) | (words_[1] & ~words_[0]));
      if (!values_fit(request.write, words_)) {
        desk.count_refused(request.write, words_, number_);
        note_refused_write(desk, Refused::kOutOfRange);
        co_return Exception::kIllegalValue;
      }
    }
    outcome = co_await desk.write(request.write, words_, number_);
  }
  if (outcome.exception != Exception::kNone) {
    note_refused_write(desk, outcome.refused);
    co_return outcome.exception;
  }
  if (outcome.commanded) {
    shared_.rate.refund(peer_, kPaidByCommand);
    if (request.function == Function::kReadWriteRegisters) co_return co_await wait_for_tick(desk, before);
  }
  co_return Exception::kNone;
}

void ClientConnection::note_refused_write(AxisDesk& desk, Refused why) {
  ++shared_.counts.refused_writes;
  desk.note_refusal(number_, why);
  if (lacks_lease(why)) {  // other mistakes concern the owner alone
    ++shared_.counts.not_owner;
    audit("forbidden", sentence_of(why), desk.axis());
  }
  if (!shared_.refused_writes_log.allow()) return;
  log::warn("{}: a write to axis {} was refused: {} ({} more since the last such line)", name_, desk.axis(),
            sentence_of(why), shared_.refused_writes_log.held_back());
}

bool ClientConnection::is_peer_gone() {
  pollfd socket{.fd = socket_.native_handle(), .events = POLLRDHUP, .revents = 0};
  return ::poll(&socket, 1, 0) > 0;
}

/// Waits for the tick after `before`; kBusy: it never comes. So an exchange gets the first sample after its
/// command, and in real time two process data within a tick count as two.
asio::awaitable<Exception> ClientConnection::wait_for_tick(AxisDesk& desk, Tick before) {
  if (shared_.engine.tick() != before) co_return Exception::kNone;
  const bool sent = co_await flush();  // earlier answers must not wait with this request
  if (!sent) open_ = false;
  desk.set_waiting(number_, true);
  waiting_ = true;
  while (open_ && shared_.engine.tick() == before && desk.holds(number_)) {
    boost::system::error_code cancelled;
    waker_.expires_after(std::chrono::milliseconds(shared_.engine.config().modbus.frame_timeout_ms));
    co_await waker_.async_wait(asio::redirect_error(asio::use_awaitable, cancelled));
    // This coroutine reads nothing during the wait, so only this check finds a peer that has gone.
    if (!cancelled && open_ && is_peer_gone()) close();
  }
  waiting_ = false;
  desk.set_waiting(number_, false);
  desk.spoke(number_);
  // If no tick has run, the lease has ended and the tick may never come.
  co_return shared_.engine.tick() != before ? Exception::kNone : Exception::kBusy;
}

}  // namespace drivebench::modbus
