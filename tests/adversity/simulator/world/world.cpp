#include "tests/adversity/simulator/world/world.hpp"

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "protocols/mcap/mcap.hpp"
#include "server/engine/stepped_engine.hpp"
#include "server/recording/replay.hpp"
#include "tests/adversity/simulator/peers/can_drive.hpp"
#include "tests/adversity/simulator/peers/cast.hpp"
#include "tests/adversity/simulator/peers/crowd.hpp"
#include "tests/adversity/simulator/peers/modbus_client.hpp"
#include "tests/fuzz/counted_memory.hpp"

namespace drivebench::simulator {
namespace {

/// Virtual time zero on the server's clock, which takes the time zero for "not set" in places.
constexpr auto kEpoch = std::chrono::hours(1);

/// Longer than every request under way, and than a stall that has just begun.
constexpr Time kTimeToSettle = 600 * kMillisecond;

/// The most that a turn of the I/O takes.
constexpr std::size_t kMostOfATurn = std::size_t{2} << 20;

/// The step of the server's clock.
constexpr Time kClockStep = 5 * kMillisecond;

void set_clock(Time now) {
  ServerClock::simulate(ServerClock::time_point(kEpoch + std::chrono::nanoseconds(now)));
}

}  // namespace

/// Reports how late the world has made a tick.
class World::VirtualPacer final : public Pacer {
 public:
  std::int64_t wait() noexcept override { return lateness_ns; }
  void resynchronise() noexcept override { resynchronised = true; }
  std::int64_t lateness_ns = 0;
  bool resynchronised = false;
};

World::World(std::uint64_t seed, bool prints, const std::string& folder)
    : seed_(seed), scene_(seed, prints), config_(draw_bench(scene_.random)) {
  set_clock(0);
  scene_.unix_path = config_.tcp.unix_path = folder + "/bench.sock";
  constexpr auto kIoEvery =
      std::to_array<Time>({0, kMillisecond / 4, kMillisecond / 2, kMillisecond, kMillisecond});
  io_every_ = scene_.random.pick(std::span(kIoEvery));
  server_ = std::make_unique<StreamServer>(io_, config_.tcp);
  waker_ = std::make_unique<ServerTimer>(io_);
  make_engine();
  scene_.engine = engine_.get();
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis) {
    scene_.axes.emplace_back(config_.setup, axis, config_.mode == RunMode::kLockstep,
                             [this](const std::string& promise) { scene_.require(false, promise); });
  }
  scene_.connected = [this] {
    return static_cast<std::size_t>(
        std::ranges::count_if(players_, [](const auto& player) { return player->has_session(); }));
  };
  engine_->on_tick.add([this] { on_tick(); });
  if (config_.tcp.asks_for_token) {
    config_.audit.file = folder + "/audit.jsonl";
    audit_ = std::make_unique<Audit>(config_.audit);
    audit_->watch(*engine_);
  }
  server_->serve(
      *engine_, [] { return std::vector<TransportReport>(); }, nullptr, audit_.get());
  open_transports();
  cast();
}

void World::make_engine() {
  std::unique_ptr<Recorder> recorder;
  if (scene_.random.chance(0.4)) recorder = make_recorder();
  if (config_.mode == RunMode::kLockstep) {
    engine_ = make_lockstep_engine(config_, std::move(recorder), io_);
    return;
  }
  auto pacer = std::make_unique<VirtualPacer>();
  pacer_ = pacer.get();
  SteppedEngine stepped = make_stepped_engine(config_, std::move(recorder), io_, std::move(pacer));
  engine_ = std::move(stepped.engine);
  tick_ = std::move(stepped.tick);
}

void World::open_transports() {
  if (!config_.can.empty()) {
    bus_ = std::make_unique<can::MemoryWire>(io_);
    can_ = std::make_unique<can::Endpoint>(io_, config_.can.front(), bus_->connect("bench"));
    can_->serve(*engine_);
  }
  if (config_.modbus.enabled) {
    modbus_ = std::make_unique<ModbusServer>(io_, config_.modbus);
    modbus_->serve(*engine_);
  }
}

void World::cast() {
  std::uint64_t number = 0;
  const auto add = [&](std::unique_ptr<Player> player, const char* name) {
    names_ += (players_.empty() ? "" : ", ") + std::string(name);
    players_.push_back(std::move(player));
  };
  for (const Manners& manners : draw_clients(scene_.random, config_))
    add(std::make_unique<StreamClient>(scene_, ++number, manners), manners.name);
  if (scene_.random.chance(0.2)) add(std::make_unique<Crowd>(scene_), "crowd");
  if (can_) {
    const auto axis = static_cast<std::uint32_t>(scene_.random.below(scene_.axes.size()));
    add(std::make_unique<CanDrive>(scene_, *bus_, config_.can.front().profile, axis), "CAN board");
  }
  for (std::uint64_t i = 0; modbus_ && i <= scene_.random.below(3); ++i)
    add(std::make_unique<ModbusClient>(scene_, ++number, [this] { return connect_modbus(); }),
        "Modbus client");
}

/// The client's end of a pair of sockets whose other end the server has.
int World::connect_modbus() {
  std::array<int, 2> ends{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends.data()) != 0) return -1;
  modbus_->start(asio::ip::tcp::socket(io_, asio::ip::tcp::v4(), ends[1]));
  return ends[0];
}

World::~World() = default;

/// The account sees every tick, although the I/O may see several of them together.
void World::on_tick() {
  const bool lockstep = config_.mode == RunMode::kLockstep;
  if (lockstep) ++ticks_;
  for (std::size_t axis = 0; axis < scene_.axes.size(); ++axis) {
    const Sample& s = engine_->newest(axis);
    const bool stalled = scene_.schedule.now() < scene_.stalled_until + kSecond;
    scene_.axes[axis].see(s, lockstep ? 0 : late_until_.at(s.tick), stalled);
    if (s.tick % 64 == 0) scene_.note("sample", axis, s.tick, s.state << 32 | s.faults);
  }
}

void World::tick() {
  const Time now = scene_.schedule.now();
  pacer_->lateness_ns = now - due_;
  if (pacer_->lateness_ns >= config_.setup.period_ns) {
    ++late_ticks_;
    scene_.note("late tick", 0, static_cast<std::uint64_t>(pacer_->lateness_ns));
  }
  late_until_.push_back(late_ticks_);
  tick_();
  ++ticks_;
  due_ = (std::exchange(pacer_->resynchronised, false) ? now : due_) + config_.setup.period_ns;
  const Time jitter = scene_.random.chance(0.05) ? scene_.random.between(0, config_.setup.period_ns) : 0;
  scene_.schedule.at(std::max(due_ + jitter, host_free_at_), [this] { tick(); });
}

/// Now and then the host takes the CPU from the ticks, from the I/O, or from both.
void World::disturb() {
  const Time now = scene_.schedule.now();
  const Time length = scene_.random.chance(0.1) ? scene_.random.between(20, 200) * kMillisecond
                                                : scene_.random.between(100, 20'000) * kMicrosecond;
  const std::uint64_t victim = scene_.random.below(3);
  if (!scene_.ending) {
    scene_.note("host stalls", victim, static_cast<std::uint64_t>(length));
    if (victim != 1) host_free_at_ = now + length;
    if (victim != 0) io_free_at_ = now + length;
    scene_.stalled += std::max<Time>(now + length - std::max(now, scene_.stalled_until), 0);
    scene_.stalled_until = std::max(scene_.stalled_until, now + length);
    if (victim != 0) scene_.schedule.at(io_free_at_, [] {});
  }
  scene_.schedule.after(scene_.random.between(50, 2000) * kMillisecond, [this] { disturb(); });
}

/// The server's clock advances in steps. Asio asks the kernel when its timers are due, which knows nothing of
/// virtual time: a timer that is always due makes Asio check them as soon as the kernel has reported it.
void World::turn_clock() {
  clock_next_ = scene_.schedule.now() / kClockStep * kClockStep + kClockStep;
  set_clock(scene_.schedule.now());
  bool woken = false;
  waker_->expires_at(ServerClock::time_point::min());
  waker_->async_wait([&woken](const boost::system::error_code&) { woken = true; });
  while (!woken) {
    io_.restart();
    io_.poll();
  }
}

void World::poll() {
  if (scene_.schedule.now() < std::max(io_free_at_, io_next_)) return;
  scene_.io.ran(scene_.schedule.now());
  io_next_ = scene_.schedule.now() + io_every_;
  if (scene_.schedule.now() >= clock_next_) turn_clock();
  io_.restart();
  const fuzz::Taken taken = fuzz::taken_by([this] { io_.poll(); });
  scene_.require(taken.peak_bytes < kMostOfATurn, "whatever clients send takes little memory");
  for (std::size_t axis = 0; axis < scene_.axes.size(); ++axis)
    scene_.axes[axis].io_done(engine_->owner(axis));
}

/// The I/O also runs while no client acts, and once more at the end of a stretch.
void World::pulse() {
  scene_.schedule.after(kClockStep, [this] { pulse(); });
  for (std::uint32_t axis = 0; axis < scene_.axes.size() && !scene_.ending; ++axis) {
    const Client* const owner = engine_->client(engine_->owner(axis));
    if (owner == nullptr || (owner->transport != "can" && owner->transport != "modbus")) continue;
    scene_.axes[axis].check_quiet(owner->transport, scene_.awake());
  }
}

void World::play_until(Time end) {
  scene_.schedule.at(end, [] {});
  while (scene_.failure.promise.empty() && scene_.schedule.next() <= end) {
    scene_.schedule.run_next();
    poll();
  }
}

Outcome World::run(Time duration) {
  if (tick_) scene_.schedule.at(due_, [this] { tick(); });
  pulse();
  disturb();
  for (const auto& player : players_) {
    scene_.schedule.after(scene_.random.between(0, 200) * kMillisecond, [&player] { player->start(); });
  }
  play_until(duration);
  if (scene_.failure.promise.empty()) finish();
  Outcome outcome{.seed = seed_,
                  .ticks = static_cast<std::uint64_t>(ticks_),
                  .events = scene_.trace.count(),
                  .hash = scene_.trace.hash(),
                  .bench = config_.name + ", " + std::string(name_of(config_.mode)),
                  .players = names_,
                  .failure = scene_.failure,
                  .tail = scene_.trace.tail()};
  return outcome;
}

void World::finish() {
  scene_.ending = true;
  for (const auto& player : players_)
    player->finish();
  play_until(scene_.schedule.now() + kTimeToSettle);
  if (!scene_.failure.promise.empty()) return;
  for (const auto& player : players_)
    player->check_end();
  for (const auto& player : players_)
    player->leave();
  // A Modbus client that disconnected keeps its lease as long as its key.
  play_until(scene_.schedule.now() + 100 * kMillisecond + (modbus_ ? kSecond + scene_.lease() : 0));
  if (!scene_.failure.promise.empty()) return;
  for (std::size_t axis = 0; axis < scene_.axes.size(); ++axis) {
    Sample last = engine_->newest(axis);
    last.owner = engine_->owner(axis);
    scene_.axes[axis].see_end(last);
  }
  const Verdict verdict = engine_->stop();
  scene_.require(verdict.ticks == static_cast<std::uint64_t>(ticks_), "every tick ran once");
  scene_.require(verdict.late_ticks == late_ticks_, "the verdict counts all late ticks");
  check_recording(verdict);
  if (audit_) check_audit();
  if (can_) can_->close();
  if (modbus_) modbus_->close();
  server_->close();
  io_.restart();
  io_.poll();
  scene_.note("ends", 0, verdict.ticks, verdict.state_hash);
}

std::unique_ptr<Recorder> World::make_recorder() {
  Random& random = scene_.random;
  FakeDisk::Faults faults;
  if (random.chance(0.3)) faults.short_write = 0.3;
  if (random.chance(0.2)) faults.write_error = 0.01;
  if (random.chance(0.2)) faults.sync_error = 0.1;
  if (random.chance(0.2)) faults.capacity = 100'000 + random.below(3'000'000);
  if (random.chance(0.3)) faults.meddling = 0.01;
  disk_ = std::make_unique<FakeDisk>(random.fork(), faults);
  RecordingOptions options;
  options.create = disk_->creator();
  options.own_thread = false;
  options.continues_after_errors = random.chance(0.5);
  if (random.chance(0.3)) options.file_ticks = 1000 + random.below(5000);
  auto recorder =
      std::make_unique<Recorder>("run.mcap", config_, std::initializer_list<RecordingAttachment>{}, options);
  recorder_ = recorder.get();
  record();
  return recorder;
}

/// The recorder runs; now and then its disk stands still for seconds.
void World::record() {
  Time next = 5 * kMillisecond;
  disk_->meddle();
  while (recorder_->work()) {
  }
  if (!scene_.ending && scene_.random.chance(0.0005)) {
    next = scene_.random.between(100, 6000) * kMillisecond;
    disk_stalled_ = true;
    scene_.time_waited = config_.mode == RunMode::kLockstep;
    scene_.note("disk stalls", 0, static_cast<std::uint64_t>(next));
  }
  scene_.schedule.after(next, [this] {
    if (recorder_ != nullptr) record();
  });
}

/// Readable samples and reported losses add up to all samples.
void World::check_recording(const Verdict& verdict) {
  if (recorder_ == nullptr) return;
  recorder_ = nullptr;
  const std::vector<std::span<const std::byte>> files = disk_->files();
  scene_.note("recording", files.size(), verdict.gaps, disk_->failed());
  scene_.require(verdict.gaps == 0 || disk_->failed() || (disk_stalled_ && !scene_.time_waited),
                 "a disk without faults loses nothing, nor does a slow one in lockstep");
  scene_.require(verdict.gaps > 0 || !disk_->lost_a_file(),
                 "a recording that another program removed is lost");
  if (verdict.gaps == 0) {
    const ReplayReport report = replay(files, nullptr);
    scene_.require(report.result == ReplayReport::Result::kEqual,
                   "a recording that lost nothing replays bit for bit: " + report.problem);
    scene_.require(report.state_hash == verdict.state_hash && report.ticks == verdict.ticks,
                   "a recording replays to the state of the run");
    return;
  }
  std::uint64_t samples = 0;
  for (const std::span<const std::byte> file : files) {
    McapReader reader(file);
    for (McapMessage message; reader.next(message);) {
      if (reader.channels().at(message.header.channel).topic.ends_with("/sample")) ++samples;
    }
    const bool damaged = reader.problem() && reader.problem()->kind == McapProblem::Kind::kDamaged;
    scene_.require(!damaged, "a recording on a bad disk is short, not damaged");
  }
  scene_.require(samples + verdict.gaps >= (verdict.ticks + 1) * config_.axes.size(),
                 "every loss of a recording is counted");
}

/// Every forbidden request of a known user has its line; wrong tokens have no more than their budget.
void World::check_audit() {
  std::uint64_t forbidden = 0;
  std::uint64_t wrong_tokens = 0;
  std::ifstream file(config_.audit.file);
  for (std::string line; std::getline(file, line);) {
    if (line.find(R"("event":"forbidden")") != std::string::npos) ++forbidden;
    if (line.find(R"("event":"authentication")") != std::string::npos) ++wrong_tokens;
  }
  const double seconds = static_cast<double>(scene_.schedule.now()) / static_cast<double>(kSecond);
  scene_.note("audit", 0, forbidden, wrong_tokens);
  const double most = Identity::kForbidden.at_once + Identity::kForbidden.per_s * seconds + 1;
  scene_.require(static_cast<double>(forbidden) <= most,
                 "a user that asks for what is forbidden has to wait");
  scene_.require(forbidden >= scene_.forbidden && audit_->lost() == 0,
                 "the audit log has every forbidden request of a known user");
  scene_.require(static_cast<double>(wrong_tokens) <=
                     AuditBudget::kOfAddress.at_once + AuditBudget::kOfAddress.per_s * seconds + 1,
                 "the audit log has a budget for wrong tokens");
}

}  // namespace drivebench::simulator
