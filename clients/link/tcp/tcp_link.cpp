#include "clients/link/tcp/tcp_link.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

namespace drivebench::link {
namespace {

using Clock = std::chrono::steady_clock;
using Kind = v1::Envelope::KindCase;

constexpr std::uint32_t kProtocol = 1;
constexpr std::size_t kFirstBlock = std::size_t{16} * 1024;

std::string name_of(Kind kind) {
  const auto* field = v1::Envelope::descriptor()->FindFieldByNumber(static_cast<int>(kind));
  return field == nullptr ? "nothing" : field->name();
}

google::protobuf::ArenaOptions starting_with(std::vector<char>& block) {
  google::protobuf::ArenaOptions options;
  options.initial_block = block.data();
  options.initial_block_size = block.size();
  return options;
}

std::string seconds(std::chrono::milliseconds duration) {
  const auto ms = duration.count();
  return ms % 1000 == 0 ? std::to_string(ms / 1000) + " s" : std::to_string(ms) + " ms";
}

}  // namespace

Link::Link(const Address& address, const LinkOptions& options)
    : Link(connect_to(address, options.deadline), to_string(address), options) {
  if (address.shares_memory) {
    share_memory(address.spin);
  } else {
    spin_ = address.spin;
  }
}

Link::Link(FileDescriptor socket, std::string peer, const LinkOptions& options)
    : socket_(std::move(socket)),
      peer_(std::move(peer)),
      deadline_(options.deadline),
      reader_(kMaxReplyFrame),
      first_block_(kFirstBlock),
      arena_(starting_with(first_block_)) {
  set_deadline(options.deadline);
  hello(options);
}

void Link::hello(const LinkOptions& options) {
  v1::Envelope& request = new_request();
  v1::Hello& mine = *request.mutable_hello();
  mine.set_protocol_min(kProtocol);
  mine.set_protocol_max(kProtocol);
  mine.set_client(options.client);
  mine.set_token(options.token);
  mine.set_conducts(options.conducts);
  welcome_ = ask(request, Kind::kWelcome).welcome();
  if (welcome_.protocol() != kProtocol) {
    fail("speaks protocol " + std::to_string(welcome_.protocol()) + ", this program speaks " +
         std::to_string(kProtocol));
  }
}

void Link::set_deadline(std::chrono::milliseconds deadline) {
  deadline_ = std::max(deadline, std::chrono::milliseconds(1));  // 0 would wait for ever
  const timeval limit = {.tv_sec = deadline_.count() / 1000, .tv_usec = deadline_.count() % 1000 * 1000};
  ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  ::setsockopt(socket_.get(), SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
}

std::uint64_t Link::lease(std::uint32_t axis, v1::LeaseRequest::Action action) {
  v1::Envelope& request = new_request();
  request.mutable_lease()->set_axis(axis);
  request.mutable_lease()->set_action(action);
  return ask(request, Kind::kDone).done().owner();
}

std::uint64_t Link::acquire(std::uint32_t axis) {
  return lease(axis, v1::LeaseRequest::ACTION_ACQUIRE);
}

void Link::renew(std::uint32_t axis) {
  lease(axis, v1::LeaseRequest::ACTION_RENEW);
}

void Link::release(std::uint32_t axis) {
  lease(axis, v1::LeaseRequest::ACTION_RELEASE);
}

std::uint64_t Link::take(std::uint32_t axis, const std::string& reason) {
  v1::Envelope& request = new_request();
  request.mutable_lease()->set_axis(axis);
  request.mutable_lease()->set_action(v1::LeaseRequest::ACTION_TAKE);
  request.mutable_lease()->set_reason(reason);
  return ask(request, Kind::kDone).done().owner();
}

const v1::ParameterValues& Link::read_parameters(std::uint32_t axis, std::span<const std::string> names) {
  v1::Envelope& request = new_request();
  request.mutable_read_parameters()->set_axis(axis);
  for (const std::string& name : names)
    request.mutable_read_parameters()->add_names(name);
  return ask(request, Kind::kParameterValues).parameter_values();
}

std::uint64_t Link::write_parameter(std::uint32_t axis, const ParameterChange& change) {
  v1::Envelope& request = new_request();
  v1::WriteParameter& write = *request.mutable_write_parameter();
  write.set_axis(axis);
  write.set_name(change.name);
  write.set_value(change.value);
  write.set_ramp_ticks(change.ramp_ticks);
  write.set_at_tick(change.at_tick);
  return ask(request, Kind::kDone).done().tick();
}

std::uint64_t Link::inject_fault(std::uint32_t axis, const FaultInjection& fault) {
  v1::Envelope& request = new_request();
  v1::InjectFault& inject = *request.mutable_inject_fault();
  inject.set_axis(axis);
  inject.set_name(fault.name);
  inject.set_value(fault.value);
  inject.set_at_tick(fault.at_tick);
  return ask(request, Kind::kDone).done().tick();
}

std::uint64_t Link::bump_shaft(std::uint32_t axis, double impulse_nms, std::uint64_t at_tick) {
  v1::Envelope& request = new_request();
  v1::ShaftBump& bump = *request.mutable_shaft_bump();
  bump.set_axis(axis);
  bump.set_impulse_nms(impulse_nms);
  bump.set_at_tick(at_tick);
  return ask(request, Kind::kDone).done().tick();
}

std::uint64_t Link::set_load(std::uint32_t axis, const LoadChange& change) {
  v1::Envelope& request = new_request();
  v1::SetLoad& load = *request.mutable_set_load();
  load.set_axis(axis);
  load.set_load_nm(change.load_nm);
  load.set_ramp_ticks(change.ramp_ticks);
  load.set_at_tick(change.at_tick);
  return ask(request, Kind::kDone).done().tick();
}

std::uint64_t Link::clear_faults(std::uint32_t axis) {
  v1::Envelope& request = new_request();
  request.mutable_clear_faults()->set_axis(axis);
  return ask(request, Kind::kDone).done().tick();
}

const v1::Status& Link::status() {
  v1::Envelope& request = new_request();
  request.mutable_status_request();
  return ask(request, Kind::kStatus).status();
}

void Link::subscribe(std::uint32_t axis, std::uint32_t decimation, std::span<const std::string> signals) {
  v1::Envelope& request = new_request();
  v1::Subscribe& subscribe = *request.mutable_subscribe();
  subscribe.set_axis(axis);
  subscribe.set_decimation(decimation);
  for (const std::string& name : signals)
    subscribe.add_signals(name);
  ask(request, Kind::kDone);
  is_subscribed_ = true;
}

std::optional<v1::Samples> Link::next_samples(std::chrono::milliseconds wait) {
  const Clock::time_point give_up = Clock::now() + wait;
  arena_.Reset();
  while (kept_.empty()) {
    if (const v1::Envelope* envelope = next_envelope()) {
      keep_unasked(*envelope);
      continue;
    }
    if (!socket_.is_open()) throw LinkError("the link to " + peer_ + " is closed");
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(give_up - Clock::now());
    pollfd waiting = {.fd = socket_.get(), .events = POLLIN, .revents = 0};
    const int ready = ::poll(&waiting, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (ready > 0) {
      receive_some();
    } else {
      return std::nullopt;  // also after a signal: the caller may want to end
    }
  }
  v1::Samples oldest = std::move(kept_.front());
  kept_.pop_front();
  kept_samples_ -= static_cast<std::size_t>(oldest.samples_size());
  oldest.set_dropped(oldest.dropped() + std::exchange(dropped_, 0));
  return oldest;
}

void Link::keep_unasked(const v1::Envelope& envelope) {
  switch (envelope.kind_case()) {
    case Kind::kSamples:
      return keep(envelope.samples());
    case Kind::kNotice:
      return keep(envelope.notice());
    case Kind::kRefusal:
      throw RefusalError(envelope.refusal());
    default:
      fail("sent " + name_of(envelope.kind_case()) + " where nothing was asked");
  }
}

void Link::keep(const v1::Samples& samples) {
  kept_.push_back(samples);
  kept_samples_ += static_cast<std::size_t>(samples.samples_size());
  while (kept_samples_ > kMaxKeptSamples && kept_.size() > 1) {
    const auto lost = static_cast<std::size_t>(kept_.front().samples_size());
    dropped_ += kept_.front().dropped() + lost;
    kept_samples_ -= lost;
    kept_.pop_front();
  }
}

void Link::keep(const v1::Notice& notice) {
  constexpr std::size_t kMost = 100;
  if (notices_.size() < kMost) notices_.push_back(notice);
  if (notice.kind() == v1::Notice::KIND_SESSION_ENDED) fail("ended the session: " + notice.message());
}

v1::Envelope& Link::new_request() {
  if (!socket_.is_open()) throw LinkError("the link to " + peer_ + " is closed");
  arena_.Reset();
  auto* request = google::protobuf::Arena::CreateMessage<v1::Envelope>(&arena_);
  request->set_id(++last_id_);
  return *request;
}

const v1::Envelope& Link::ask(v1::Envelope& request, Kind expected) {
  send(request);
  const v1::Envelope& answer = await_answer();
  if (answer.kind_case() == Kind::kRefusal) throw RefusalError(answer.refusal());
  if (answer.kind_case() != expected) {
    fail("answered with " + name_of(answer.kind_case()) + " where " + name_of(expected) + " was due");
  }
  return answer;
}

void Link::send(const v1::Envelope& request) {
  const std::size_t size = request.ByteSizeLong();
  out_.resize(kFrameHeaderSize + size);
  std::ranges::copy(frame_header(static_cast<std::uint32_t>(size)), out_.begin());
  request.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(out_.data() + kFrameHeaderSize));
  std::span<const std::byte> left = out_;
  while (!left.empty()) {
    const ssize_t sent = ::send(socket_.get(), left.data(), left.size(), MSG_NOSIGNAL);
    if (sent >= 0) {
      left = left.subspan(static_cast<std::size_t>(sent));
    } else if (errno == EAGAIN) {
      fail("took no request within " + seconds(deadline_));
    } else if (errno != EINTR) {
      fail_ended(errno);
    }
  }
}

const v1::Envelope& Link::await_answer() {
  // The socket's time-out covers silence; this deadline covers a peer that keeps sending other messages. The
  // clock is read only if the answer does not come at once, which saves a call in most exchanges.
  std::optional<Clock::time_point> give_up;
  for (bool first = true;; first = false) {
    while (const v1::Envelope* envelope = next_envelope()) {
      if (envelope->kind_case() == Kind::kSamples) {
        keep(envelope->samples());
      } else if (envelope->kind_case() == Kind::kNotice) {
        keep(envelope->notice());
      } else if (envelope->id() == last_id_ ||
                 (envelope->id() == 0 && envelope->kind_case() == Kind::kRefusal)) {
        return *envelope;
      } else {
        fail("answered request " + std::to_string(envelope->id()) + " when " + std::to_string(last_id_) +
             " was asked");
      }
    }
    if (!first) {
      const Clock::time_point now = Clock::now();
      if (!give_up) give_up = now + deadline_;
      if (now > *give_up) fail_late();
    }
    receive_some();
  }
}

v1::Envelope* Link::next_envelope() {
  const auto payload = reader_.next();
  if (!reader_.error().empty()) {
    fail("does not speak this protocol: it sent " + std::string(reader_.error()));
  }
  if (!payload) return nullptr;
  auto* envelope = google::protobuf::Arena::CreateMessage<v1::Envelope>(&arena_);
  if (!envelope->ParseFromArray(payload->data(), static_cast<int>(payload->size()))) {
    fail("does not speak this protocol: it sent a frame that is no envelope");
  }
  return envelope;
}

void Link::receive_some() {
  if (!socket_.is_open()) throw LinkError("the link to " + peer_ + " is closed");
  const std::span<std::byte> space = reader_.free_space();
  if (spin_.count() > 0 && look_before_sleeping(space)) return;
  for (;;) {
    const std::ptrdiff_t received = taken_ == nullptr ? ::recv(socket_.get(), space.data(), space.size(), 0)
                                                      : receive_with_descriptors(space);
    if (received > 0) return reader_.received(static_cast<std::size_t>(received));
    if (received == 0) fail_ended(0);
    if (errno == EAGAIN) fail_late();
    if (errno != EINTR) fail_ended(errno);
  }
}

/// Whether something came while this thread looked for it; an end or an error is left to the next call.
bool Link::look_before_sleeping(std::span<std::byte> space) {
  const Clock::time_point end = Clock::now() + spin_;
  do {
    const ssize_t received = ::recv(socket_.get(), space.data(), space.size(), MSG_DONTWAIT);
    if (received > 0) {
      reader_.received(static_cast<std::size_t>(received));
      return true;
    }
    if (received == 0 || (errno != EAGAIN && errno != EINTR)) return false;
  } while (Clock::now() < end);
  return false;
}

void Link::fail_late() {
  fail("gave no answer within " + seconds(deadline_));
}

void Link::fail_ended(int error) {
  if (error == 0 || error == ECONNRESET || error == EPIPE) fail("closed the connection");
  fail("closed the connection: " + std::generic_category().message(error));
}

void Link::fail(const std::string& what) {
  socket_.close();
  throw LinkError(peer_ + " " + what);
}

}  // namespace drivebench::link
