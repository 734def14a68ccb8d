#include "tests/adversity/simulator/peers/stream_client.hpp"

#include <algorithm>

#include "plant/faults.hpp"
#include "server/endpoints/tcp/session/identity.hpp"

namespace drivebench::simulator {
namespace {

constexpr std::size_t kReadCapacity = std::size_t{256} * 1024;
/// The server ends a session that does not say hello within 2 s.
constexpr Time kHelloLimit = 2 * kSecond;
/// For steps of the server's clock, and bytes on their way.
constexpr Time kSlack = 50 * kMillisecond;
/// A client that must get in may need some attempts, if newer connections take its place.
constexpr Time kGetsInWithin = 2 * kSecond;
/// By then the server has noticed every closed connection.
constexpr Time kSettled = 500 * kMillisecond;
/// Messages that come later may be unread at the end.
constexpr std::uint64_t kLastWords = 20 * kMillisecond;

}  // namespace

StreamClient::StreamClient(Scene& scene, std::uint64_t number, const Manners& manners)
    : scene_(scene),
      number_(number),
      manners_(manners),
      random_(scene.random.fork()),
      own_axis_(static_cast<std::uint32_t>(random_.below(scene.axes.size()))) {
  forget();
}

void StreamClient::forget() {
  greeted_ = raw_ = false;
  owner_ = 0;
  leased_.assign(axis_count(), false);
  newest_.assign(axis_count(), 0);
  latched_.assign(axis_count(), false);
  samples_.assign(axis_count(), {});
  for (const auto& [id, asked] : asked_) {
    if (asked.kind == v1::Envelope::kClearFaults) scene_.axes[asked.axis].clear_unanswered();
    if (asked.action == v1::LeaseRequest::ACTION_TAKE)
      scene_.schedule.after(kSecond, [&axis = scene_.axes[asked.axis]] { axis.force_ends(); });
  }
  asked_.clear();
}

void StreamClient::take_turn() {
  if (scene_.ending) return;
  if (scene_.schedule.now() < manners_.begins)
    return scene_.schedule.at(manners_.begins, [this] { take_turn(); });
  act();
  scene_.schedule.after(manners_.turn + random_.between(0, manners_.turn / 4), [this] { take_turn(); });
}

void StreamClient::act() {
  if (!greeted_ && !outside_since_) outside_since_ = scene_.awake();
  scene_.require(!manners_.gets_in || !outside_since_ || scene_.awake() < *outside_since_ + kGetsInWithin,
                 "a client gets in beside any crowd");
  if (!wire_ || !wire_->is_open()) {
    connect();
    return;
  }
  if (manners_.babbles > 0 && random_.chance(manners_.babbles)) return babble();
  if (random_.chance(manners_.leaves)) return disconnect("vanishes");
  if (random_.chance(manners_.stops)) {
    const Time until = scene_.schedule.now() + random_.between(kMillisecond, 3 * kSecond);
    scene_.note("network stops", number_, static_cast<std::uint64_t>(until));
    wire_->stop_until(until);
  }
  if (!greeted_) return;
  if (manners_.gorges > 0 && random_.chance(manners_.gorges)) gorge();
  if (random_.chance(manners_.shuts)) {
    scene_.note("half closes", number_);
    for (AxisAccount& axis : scene_.axes)
      axis.may_go(owner_);
    wire_->shut();
    return;
  }
  nag();
}

void StreamClient::nag() {
  const std::uint32_t axis = some_axis();
  if (random_.chance(manners_.takes)) lease(axis, v1::LeaseRequest::ACTION_ACQUIRE);
  if (random_.chance(manners_.gives)) lease(axis, v1::LeaseRequest::ACTION_RELEASE);
  if (random_.chance(manners_.forces)) lease(axis, v1::LeaseRequest::ACTION_TAKE);
  if (random_.chance(manners_.steals) && !asks_for_lease(axis)) command(axis);
  if (random_.chance(manners_.clears)) clear(axis);
  if (random_.chance(manners_.changes)) change(axis);
  if (random_.chance(manners_.asks)) ask_something(axis);
  const bool busy = std::ranges::any_of(
      asked_, [](const auto& each) { return each.second.kind == v1::Envelope::kExchange; });
  if (manners_.controls && !busy) control();
}

void StreamClient::connect() {
  const int socket = connect_to(scene_.unix_path);
  scene_.note("connects", number_, socket >= 0);
  if (socket < 0) return;
  forget();
  ++connection_;
  connected_at_ = scene_.schedule.now();
  wire_ = std::make_shared<Wire>(scene_.schedule, random_.fork(), manners_.quality, socket);
  reader_.emplace(kReadCapacity);
  if (manners_.greets) {
    v1::Envelope hello;
    hello.mutable_hello()->set_protocol_min(1);
    hello.mutable_hello()->set_protocol_max(1);
    hello.mutable_hello()->set_client(manners_.name);
    hello.mutable_hello()->set_token(manners_.token);
    ask(hello);
  }
  read();
}

void StreamClient::disconnect(const char* how) {
  if (!wire_ || !wire_->is_open()) return;
  scene_.note(how, number_);
  wire_->cut();
  for (std::uint32_t axis = 0; owner_ != 0 && axis < axis_count(); ++axis)
    scene_.axes[axis].gone(owner_, asks_for_lease(axis));
  forget();
}

bool StreamClient::asks_for_lease(std::uint32_t axis) const {
  return std::ranges::any_of(asked_, [axis](const auto& each) {
    return each.second.kind == v1::Envelope::kLease && each.second.axis == axis;
  });
}

void StreamClient::read() {
  std::size_t budget = manners_.read_most;
  while (budget > 0 && wire_->is_open()) {
    const std::size_t room = std::min(budget, reader_->free_space().size());
    const std::span<const std::byte> bytes = wire_->receive(room);
    if (bytes.empty()) break;
    std::ranges::copy(bytes, reader_->free_space().begin());
    reader_->received(bytes.size());
    budget = bytes.size() < room ? 0 : budget - bytes.size();
    while (const auto frame = reader_->next())
      on_frame(*frame);
    scene_.require(reader_->error().empty(), "the server sends whole frames");
  }
  if (!wire_->is_open()) {
    scene_.note("is cut off", number_);
    return forget();
  }
  scene_.require(
      manners_.greets || scene_.io.last_run() <= scene_.io.end_of(connected_at_, kHelloLimit) + kSlack,
      "a session without hello ends after 2 s");
  scene_.schedule.after(manners_.read_every + random_.between(0, manners_.read_every / 8),
                        [this, connection = connection_] {
                          if (connection == connection_ && wire_->is_open()) read();
                        });
}

void StreamClient::on_frame(std::span<const std::byte> frame) {
  scene_.require(answer_.ParseFromArray(frame.data(), static_cast<int>(frame.size())),
                 "every frame of the server is an Envelope");
  scene_.note("hears", number_, static_cast<std::uint64_t>(answer_.kind_case()), answer_.id());
  if (answer_.kind_case() == v1::Envelope::kSamples) return on_samples(answer_.samples());
  if (answer_.id() == 0) {
    return scene_.require(
        answer_.kind_case() == v1::Envelope::kRefusal || answer_.kind_case() == v1::Envelope::kNotice,
        "messages without a request are samples, refusals and notices");
  }
  const auto found = asked_.find(answer_.id());
  if (raw_ && found == asked_.end()) return;
  scene_.require(found != asked_.end(), "an answer belongs to one request");
  if (found == asked_.end()) return;
  const Asked asked = found->second;
  asked_.erase(found);
  if (asked.action == v1::LeaseRequest::ACTION_TAKE) scene_.axes[asked.axis].force_ends();
  scene_.require(asked.kind != v1::Envelope::KIND_NOT_SET || answer_.kind_case() == v1::Envelope::kRefusal,
                 "a frame with more than a request may have is refused");
  switch (answer_.kind_case()) {
    case v1::Envelope::kWelcome:
      greeted_ = true;
      outside_since_.reset();
      nag();
      for (std::uint32_t axis = 0; manners_.every > 0 && axis < axis_count(); ++axis) {
        v1::Envelope request;
        request.mutable_subscribe()->set_axis(axis);
        request.mutable_subscribe()->set_decimation(manners_.every);
        ask(request, axis);
      }
      return;
    case v1::Envelope::kDone:
      return on_done(asked, answer_.done());
    case v1::Envelope::kRefusal:
      return on_refusal(asked, answer_.refusal());
    case v1::Envelope::kExchangeReply:
      for (const v1::AxisSample& each : answer_.exchange_reply().samples()) {
        scene_.require(!asked.counts || (each.axis() == asked.axis && each.sample().tick() > asked.tick),
                       "an exchange is answered with the samples after its command");
        is_told(each.axis(), each.sample());
      }
      if (manners_.controls) control_later();
      return;
    case v1::Envelope::kStatus:
      if (answer_.id() == last_look_) on_last_look(answer_.status().sessions());
      for (const v1::AxisSample& each : answer_.status().axes())
        is_told(each.axis(), each.sample(), true);
      return;
    default:
      return;
  }
}

/// No client connects any more; a session that ended between question and answer may have been counted or
/// not.
void StreamClient::on_last_look(std::uint64_t sessions) {
  scene_.require(sessions <= sessions_when_asked_ && sessions >= scene_.connected(),
                 "the server keeps exactly the connected sessions");
}

void StreamClient::on_done(const Asked& asked, const v1::Done& done) {
  const auto tick = static_cast<Tick>(done.tick());
  AxisAccount& account = scene_.axes[asked.axis];
  if (asked.kind == v1::Envelope::kSubscribe) {
    samples_[asked.axis] = {.every = manners_.every, .last = done.tick()};
  } else if (asked.kind == v1::Envelope::kClearFaults) {
    latched_[asked.axis] = false;
    account.clear_done(owner_, tick);
    if (manners_.controls) control_later();
  } else if (asked.kind == v1::Envelope::kLease) {
    owner_ = done.owner();
    if (asked.action == v1::LeaseRequest::ACTION_TAKE) account.came_by_force(owner_);
    leased_[asked.axis] = asked.action != v1::LeaseRequest::ACTION_RELEASE;
    if (!leased_[asked.axis]) return;
    account.granted(owner_, tick, asked.forces, [wire = std::weak_ptr(wire_)] {
      const auto there = wire.lock();
      return there && there->is_connected();
    });
    for (const auto& [id, other] : asked_) {
      if (other.action == v1::LeaseRequest::ACTION_RELEASE && other.axis == asked.axis)
        account.may_go(owner_);
    }
    if (manners_.controls) control_later();
  }
}

void StreamClient::on_refusal(const Asked& asked, const v1::Refusal& refusal) {
  scene_.require(!refusal.message().empty() && refusal.code() != v1::REFUSAL_UNSPECIFIED,
                 "a refusal says why");
  scene_.note("is refused", number_, static_cast<std::uint64_t>(refusal.code()),
              static_cast<std::uint64_t>(asked.kind));
  if (refusal.code() == v1::REFUSAL_FORBIDDEN) {
    ++scene_.forbidden;
    ++forbidden_;
  }
  if (refusal.code() == v1::REFUSAL_NOT_OWNER) leased_[asked.axis] = false;
  if (refusal.code() == v1::REFUSAL_LATCHED) latched_[asked.axis] = true;
  const bool counted = refusal.code() == v1::REFUSAL_LATCHED || refusal.code() == v1::REFUSAL_STALE ||
                       refusal.code() == v1::REFUSAL_NOT_FINITE;
  // An exchange that waited was valid on arrival.
  const bool robbed = refusal.message().find("was taken by") != std::string::npos;
  const bool without_lease = refusal.code() == v1::REFUSAL_NOT_OWNER;
  if (asked.counts && without_lease) scene_.axes[asked.axis].command_without_lease();
  if (asked.counts && counted && !robbed && !scene_.time_waited) {
    scene_.axes[asked.axis].command_refused(owner_, asked.sent);
  }
  if (asked.kind == v1::Envelope::kExchange && manners_.controls) {
    v1::Envelope request;
    request.mutable_exchange();  // asks for the newest tick
    if (!scene_.ending) ask(request);
  }
}

void StreamClient::on_samples(const v1::Samples& samples) {
  scene_.require(samples.axis() < axis_count(), "samples are those of an axis");
  Subscription& s = samples_[samples.axis()];
  scene_.require(s.every > 0, "only subscribers get samples");
  if (s.every == 0) return;
  std::uint64_t skipped = samples.dropped();
  const bool stalled = scene_.schedule.now() < scene_.stalled_until + kSecond;
  scene_.require(!manners_.gets_all || skipped == 0 || stalled, "a healthy viewer gets all its samples");
  for (const v1::Sample& sample : samples.samples()) {
    scene_.require(sample.tick() % s.every == 0, "samples are those of every n-th tick");
    scene_.require(sample.tick() / s.every == s.last / s.every + skipped + 1,
                   "a viewer is told of exactly its lost samples");
    s.last = sample.tick();
    skipped = 0;
    // The first and the last sample of a message are compared whole, which takes time.
    const bool at_end = &sample == &*samples.samples().begin() || &sample == &*samples.samples().rbegin();
    at_end ? is_told(samples.axis(), sample) : see(samples.axis(), sample);
  }
}

void StreamClient::is_told(std::uint32_t axis, const v1::Sample& sample, bool in_status) {
  scene_.axes[axis].told(sample, in_status);
  see(axis, sample);
}

void StreamClient::see(std::uint32_t axis, const v1::Sample& sample) {
  newest_[axis] = std::max(newest_[axis], sample.tick());
  latched_[axis] = (sample.faults() & kLatchedFaults) != 0;
  if (sample.owner() != owner_) leased_[axis] = false;
}

void StreamClient::finish() {
  manners_.quality = {};
  manners_.read_every = kMillisecond;
  manners_.read_most = 65536;
  if (!wire_ || !wire_->is_open()) return;
  wire_->heal();
  ++connection_;  // drops its scheduled turns
  read();
  scene_.schedule.after(kSettled, [this] {
    v1::Envelope request;
    request.mutable_status_request();
    if (!wire_->is_open() || !greeted_ || raw_) return;
    sessions_when_asked_ = scene_.connected();
    last_look_ = ask(request);
  });
}

void StreamClient::check_end() {
  if (!wire_ || !wire_->is_open() || raw_ || !greeted_) return;
  const bool lockstep = scene_.engine->config().mode == RunMode::kLockstep;
  for (const auto& [id, asked] : asked_) {
    if (static_cast<double>(forbidden_) > Identity::kForbidden.at_once / 2) break;  // the server may pause
    // In lockstep it may wait for the command of another one.
    scene_.require(lockstep && asked.kind == v1::Envelope::kExchange, "every request has an answer");
  }
  for (const Subscription& s : samples_) {
    if (s.every == 0) continue;
    const auto now = static_cast<std::uint64_t>(scene_.engine->tick());
    const std::uint64_t on_the_way =
        kLastWords / static_cast<std::uint64_t>(scene_.engine->config().setup.period_ns);
    scene_.require(lockstep ? s.last / s.every == now / s.every : s.last + on_the_way + s.every >= now,
                   "a viewer gets all samples up to the last");
  }
}

}  // namespace drivebench::simulator
