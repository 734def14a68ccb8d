// Sequences of messages: four clients, each with a session of the server, and a bench of two axes in
// lockstep. The bytes are a program of the clients. For every program: an axis has at most one owner, whose
// session is connected; time advances only with commands; the plant stays finite; only an owner clears a
// latched fault; every request has one answer.
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "plant/injected_faults.hpp"
#include "server/endpoints/tcp/session/session.hpp"
#include "server/host/asio.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/peer_memory.hpp"
#include "tests/fuzz/session_program.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::fuzz {
namespace {

constexpr std::size_t kPeers = 4;
constexpr std::size_t kMaxSteps = 400;

/// The client side of a session.
struct Peer {
  int socket = -1;
  std::weak_ptr<Session> session;
  std::string received;
  std::uint64_t last_id = 0;
  struct Asked {
    v1::Envelope::KindCase kind;
    std::uint32_t cleared_axis;
    std::vector<std::uint32_t> commanded_axes;
    bool possible;  ///< all its numbers are finite
  };
  std::map<std::uint64_t, Asked> asked;  ///< not answered yet, by id
  std::unique_ptr<PeerMemory> memory;    ///< that its session shares
  bool raw = false;                      ///< it sent bytes that are no requests of this program
  bool greeted = false;
  bool came = false;
  Owner owner = 0;

  bool is_there() const { return socket >= 0 && !session.expired(); }
};

BenchConfig two_axes() {
  BenchConfig config = servo_bench(2);
  config.setup.command_delay_ticks = 1;
  config.setup.watchdog_ticks = 5;
  config.setup.lease_ticks = 20;
  return config;
}

class World {
 public:
  World()
      : engine_(make_lockstep_engine(config())),
        audience_(io_, *engine_),
        context_{.engine = *engine_,
                 .admission = Admission(false, {}),
                 .audience = audience_,
                 .spinner = spinner_,
                 .session_count = [] { return kPeers; },
                 .transports = [] { return std::vector<TransportReport>{}; },
                 .experiments = nullptr} {
    engine_->on_tick.add([this] { audience_.on_tick(); });
    engine_->on_newest.add([this] { audience_.on_newest(); });
  }

  ~World() {
    for (Peer& peer : peers_)
      disconnect(peer);
    settle();
    for (std::size_t axis = 0; axis < 2; ++axis)
      require(engine_->owner(axis) == 0, "without clients no axis has an owner");
    engine_->stop();
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  void step(Program& program) {
    const unsigned byte = program.next();
    Peer& peer = peers_[byte % kPeers];
    if (!peer.came) {
      connect(peer, &peer != &peers_.back());  // the last one may begin without hello
      settle();
    }
    const std::int64_t before = engine_->tick();
    const std::array<std::uint64_t, 2> latched{latched_of(0), latched_of(1)};
    steps_allowed_ = 2;  // a session that ends gives both axes back, and the tick may have waited for each
    program.all_finite();
    act(peer, byte / kPeers, program);
    settle();
    require(engine_->tick() >= before && engine_->tick() <= before + steps_allowed_,
            "time advances tick by tick, and only with commands");
    for (std::size_t axis = 0; axis < 2; ++axis) {
      check_axis(axis);
      require((latched[axis] & ~latched_of(axis)) == 0 || cleared_[axis],
              "only the owner clears a latched fault");
      const auto state = static_cast<ControlState>(engine_->newest(axis).state);
      require((latched[axis] & latched_of(axis)) == 0 || cleared_[axis] || engine_->tick() == before ||
                  state == ControlState::kTimeout || state == ControlState::kFault,
              "a latched axis is not commanded");
      if (engine_->tick() > before) cleared_[axis] = false;  // samples show it from the next tick on
    }
  }

 private:
  static const BenchConfig& config() {
    static const BenchConfig result = two_axes();
    return result;
  }

  std::uint64_t latched_of(std::size_t axis) const { return engine_->newest(axis).faults & kLatchedFaults; }

  void connect(Peer& peer, bool greets) {
    std::array<int, 2> ends{};
    require(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends.data()) == 0,
            "there are sockets");
    peer = Peer{};
    peer.came = true;
    peer.socket = ends[0];
    auto session = std::make_shared<Session>(
        Outbox::Socket(asio::local::stream_protocol::socket(io_, asio::local::stream_protocol(), ends[1])),
        Client{"unix", "peer", ""}, context_, context_.places.enter("unix").number);
    peer.session = session;
    asio::co_spawn(
        io_, [session]() { return session->run(); }, asio::detached);
    if (greets) greet(peer);
  }

  void disconnect(Peer& peer) {
    if (peer.socket >= 0) ::close(peer.socket);
    peer.socket = -1;
    peer.memory.reset();
  }

  /// Runs until no work is left; all messages of the sessions are then with the peers.
  void settle() {
    for (std::size_t handled = 1; handled != 0;) {
      io_.restart();
      handled = io_.poll();
      for (Peer& peer : peers_)
        handled += receive(peer);
    }
  }

  std::size_t receive(Peer& peer) {
    if (peer.socket < 0) return 0;
    std::array<char, 65536> buffer;  // NOLINT(cppcoreguidelines-pro-type-member-init): filled by recv
    std::size_t total = 0;
    for (;;) {
      const ssize_t count = receive_some(peer, buffer);
      if (count <= 0) break;
      peer.received.append(buffer.data(), static_cast<std::size_t>(count));
      total += static_cast<std::size_t>(count);
    }
    while (read_answer(peer)) {
    }
    return total;
  }

  /// Takes descriptors that come with the bytes: the memory that the session shares.
  static ssize_t receive_some(Peer& peer, std::span<char> buffer) {
    std::array<int, 2> descriptors{-1, -1};
    alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof descriptors)> control{};
    iovec part{.iov_base = buffer.data(), .iov_len = buffer.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t count = ::recvmsg(peer.socket, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    if (count <= 0) return count;
    if (const cmsghdr* const rights = CMSG_FIRSTHDR(&message); rights != nullptr) {
      require(rights->cmsg_len == CMSG_LEN(sizeof descriptors) && !peer.memory,
              "a session shares memory once");
      std::memcpy(descriptors.data(), CMSG_DATA(rights), sizeof descriptors);
      peer.memory = std::make_unique<PeerMemory>(descriptors[0], descriptors[1]);
    }
    return count;
  }

  bool read_answer(Peer& peer) {
    if (peer.received.size() < kFrameHeaderSize) return false;
    std::size_t size = 0;
    for (std::size_t i = 0; i < kFrameHeaderSize; ++i)
      size = size << 8 | static_cast<std::uint8_t>(peer.received[i]);
    require(size > 0 && size <= kMaxReplyFrame, "an answer keeps to its limit");
    if (peer.received.size() < kFrameHeaderSize + size) return false;
    v1::Envelope answer;
    require(answer.ParseFromArray(peer.received.data() + kFrameHeaderSize, static_cast<int>(size)),
            "an answer is an Envelope");
    peer.received.erase(0, kFrameHeaderSize + size);
    check_answer(peer, answer);
    return true;
  }

  void check_answer(Peer& peer, const v1::Envelope& answer) {
    if (answer.kind_case() == v1::Envelope::kRefusal) {
      require(!answer.refusal().message().empty() && answer.refusal().code() != v1::REFUSAL_UNSPECIFIED,
              "a refusal says why");
    }
    if (peer.raw) cleared_ = {true, true};  // its requests are unknown
    if (answer.id() == 0 || peer.raw) return;
    const auto found = peer.asked.find(answer.id());
    require(found != peer.asked.end(), "an answer belongs to a request that had none");
    const Peer::Asked asked = found->second;
    peer.asked.erase(found);
    require(asked.possible || answer.kind_case() == v1::Envelope::kRefusal,
            "a request with a value that is no number is refused");
    if (answer.kind_case() == v1::Envelope::kWelcome) peer.greeted = true;
    if (answer.kind_case() != v1::Envelope::kDone) return;
    require(peer.greeted, "a request before hello is refused");
    if (asked.kind == v1::Envelope::kLease) peer.owner = answer.done().owner();
    if (asked.kind != v1::Envelope::kClearFaults) return;
    require(peer.owner != 0 && engine_->owner(asked.cleared_axis) == peer.owner, "only the owner clears");
    cleared_[asked.cleared_axis] = true;
  }

  void check_axis(std::size_t axis) const {
    const Sample& s = engine_->newest(axis);
    for (const double number : {s.u_a_v, s.u_b_v, s.i_a_a, s.i_b_a, s.true_i_a_a, s.speed_rad_s, s.torque_nm})
      require(std::isfinite(number), "the plant stays finite");
    const Owner owner = engine_->owner(axis);
    if (owner == 0) return;
    require(std::ranges::any_of(
                peers_,
                [owner](const Peer& peer) { return peer.is_there() && (peer.owner == owner || peer.raw); }),
            "an owner is connected");
    for (const Peer& peer : peers_)
      require(&peer == &peers_[0] || peer.owner == 0 || peer.owner != peers_[0].owner,
              "owners have numbers of their own");
  }

  void send(Peer& peer, const std::string& bytes) const {
    if (peer.socket >= 0) static_cast<void>(!::send(peer.socket, bytes.data(), bytes.size(), MSG_NOSIGNAL));
  }

  static std::string framed(const std::string& payload) {
    const auto header = frame_header(static_cast<std::uint32_t>(payload.size()));
    return std::string(reinterpret_cast<const char*>(header.data()), header.size()) + payload;
  }

  void ask(Peer& peer, v1::Envelope& request, bool possible = true) const {
    request.set_id(++peer.last_id);
    if (peer.is_there()) {
      Peer::Asked& asked = peer.asked[request.id()];
      asked = {request.kind_case(), request.clear_faults().axis(), {}, possible};
      for (const v1::Command& command : request.exchange().commands())
        asked.commanded_axes.push_back(command.axis());
    }
    send(peer, framed(request.SerializeAsString()));
  }

  void greet(Peer& peer) const {
    v1::Envelope request;
    request.mutable_hello()->set_protocol_min(1);
    request.mutable_hello()->set_protocol_max(1);
    ask(peer, request);
  }

  void command(v1::Envelope& request, std::uint32_t axis, Program& program) const {
    v1::Command& c = *request.mutable_exchange()->add_commands();
    const unsigned how = program.next();
    const std::int64_t tick =
        engine_->tick() + static_cast<std::int64_t>(how % 8 < 5 ? 0 : how % 8) - (how % 8 == 7 ? 9 : 0);
    c.set_axis(axis);
    c.set_tick(static_cast<std::uint64_t>(tick));
    c.set_gates(static_cast<v1::Gates>(how / 8 < 20 ? 1 : how / 8 % 5));
    const double a = program.value();
    const double b = how % 3 == 0 ? 1.0 : program.value();
    c.set_u_a_v(a);  // the gates decide which of them counts
    c.set_u_b_v(b);
    c.set_i_a_a(a);
    c.set_i_b_a(b);
    c.set_d_a(a);
    c.set_d_b(b);
  }

  /// The numbers stand in the corpus: only append.
  void act(Peer& peer, unsigned action, Program& program) {
    v1::Envelope request;
    const unsigned which = action % 24 < 3 ? 0 : program.next();
    const std::uint32_t axis = which % 8 < 4 ? 0 : which % 8 < 7 ? 1 : 2;
    const std::uint64_t at_tick = which < 128 ? 0 : static_cast<std::uint64_t>(engine_->tick()) + which % 32;
    switch (action % 24) {
      case 0:
        if (peer.greeted && program.next() % 4 != 0) return;  // a second hello costs much and finds little
        return greet(peer);
      case 1:
        request.mutable_exchange();
        break;
      case 2:
        request.mutable_status_request();
        break;
      case 3:
      case 4:
        request.mutable_lease()->set_axis(axis);
        request.mutable_lease()->set_action(
            static_cast<v1::LeaseRequest::Action>(which / 8 < 20 ? 1 : which / 8 % 6));
        break;
      case 5:
      case 6:
      case 7:
        command(request, axis, program);
        break;
      case 8:
        command(request, 0, program);
        command(request, 1, program);
        break;
      case 9:
        request.mutable_clear_faults()->set_axis(axis);
        break;
      case 10:
        request.mutable_set_load()->set_axis(axis);
        request.mutable_set_load()->set_load_nm(program.value());
        request.mutable_set_load()->set_at_tick(at_tick);
        request.mutable_set_load()->set_ramp_ticks(which % 3);
        break;
      case 11: {
        const auto rows = axis_parameters(engine_->parameters(0));
        request.mutable_write_parameter()->set_axis(axis);
        request.mutable_write_parameter()->set_name(std::string(rows[program.next() % rows.size()].name));
        request.mutable_write_parameter()->set_value(program.value());
        request.mutable_write_parameter()->set_at_tick(at_tick);
        break;
      }
      case 12:
        request.mutable_inject_fault()->set_axis(axis);
        request.mutable_inject_fault()->set_name(
            std::string(kInjectableFaults[program.next() % kInjectableFaultCount].name));
        request.mutable_inject_fault()->set_value(program.value());
        request.mutable_inject_fault()->set_at_tick(at_tick);
        break;
      case 13:
        request.mutable_shaft_bump()->set_axis(axis);
        request.mutable_shaft_bump()->set_impulse_nms(program.value());
        request.mutable_shaft_bump()->set_at_tick(at_tick);
        break;
      case 14:
        request.mutable_subscribe()->set_axis(axis);
        request.mutable_subscribe()->set_decimation(which / 8);
        break;
      case 15:
        request.mutable_read_parameters()->set_axis(axis);
        break;
      case 16:
        return go_on(peer, axis, which);
      case 17:
        disconnect(peer);
        settle();
        return connect(peer, which % 4 != 0);
      case 18:
        if (peer.socket >= 0) ::shutdown(peer.socket, SHUT_WR);
        return;
      case 19:
        request.mutable_run_experiment();
        break;
      case 20:
        peer.raw = true;
        return send(peer, framed(program.next_bytes()));
      case 21:
        peer.raw = true;
        steps_allowed_ = 64;
        return send(peer, program.next_bytes());
      case 22:
        request.mutable_share_memory()->set_spin_us(which < 32 ? 101
                                                               : 0);  // spinning would depend on the clock
        break;
      case 23:
        return write_to_memory(peer, which, program);
      default:
        break;  // an empty Envelope
    }
    ask(peer, request, program.all_finite());
  }

  /// An exchange in shared memory, or whatever the program says.
  void write_to_memory(Peer& peer, unsigned which, Program& program) {
    if (!peer.memory) return;
    shm::Request& request = peer.memory->segment().request;
    if (which % 4 == 0) {
      peer.raw = true;
      steps_allowed_ = 64;
      const std::string bytes = program.next_bytes();
      const std::size_t at = which / 4 < 32 ? 0 : program.next() * 32 % sizeof(shm::Segment);
      const std::size_t size = std::min(bytes.size(), sizeof(shm::Segment) - at);
      std::memcpy(reinterpret_cast<char*>(&peer.memory->segment()) + at, bytes.data(), size);
    } else {
      request.count = which % 4 - 1;
      for (std::uint64_t i = 0; i < request.count; ++i) {
        request.commands.at(i) = {.axis = i,
                                  .tick = static_cast<std::uint64_t>(engine_->tick()),
                                  .gates = static_cast<std::int64_t>(which / 4 % 7),
                                  .legs_off = 0,
                                  .setpoint = {.a = program.value(), .b = program.value()},
                                  .edges = {}};
      }
      ++request.number;
    }
    peer.memory->ring();
  }

  /// Some ticks with commands of this peer, as a healthy controller sends them.
  void go_on(Peer& peer, std::uint32_t axis, unsigned ticks) {
    steps_allowed_ = 2 + static_cast<std::int64_t>(ticks / 8);
    for (unsigned i = 0; i < ticks / 8 && peer.is_there(); ++i) {
      v1::Envelope request;
      v1::Command& c = *request.mutable_exchange()->add_commands();
      c.set_axis(axis);
      c.set_tick(static_cast<std::uint64_t>(engine_->tick()));
      c.set_gates(latched_of(axis % 2) != 0 ? v1::GATES_OFF : v1::GATES_VOLTAGE);
      c.set_u_a_v(2.0);
      ask(peer, request);
      settle();
    }
  }

 public:
  /// An exchange may wait for the other axis; every other request must have its answer.
  void check_that_all_was_answered() const {
    for (const Peer& peer : peers_) {
      if (!peer.is_there() || peer.raw) continue;
      std::size_t waiting = 0;
      for (const auto& [id, asked] : peer.asked) {
        require(asked.kind == v1::Envelope::kExchange, "a request has an answer");
        for (const std::uint32_t axis : asked.commanded_axes)
          require(engine_->owner(axis) == peer.owner, "a session that waits for a tick of an axis owns it");
        ++waiting;
      }
      require(waiting <= 1, "of a session one exchange waits");
    }
  }

 private:
  asio::io_context io_{1};
  std::unique_ptr<Engine> engine_;
  Audience audience_;
  Spinner spinner_{io_};
  SessionContext context_;
  std::array<Peer, kPeers> peers_;
  std::array<bool, 2> cleared_{};
  std::int64_t steps_allowed_ = 0;
};

}  // namespace
}  // namespace drivebench::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench::fuzz;
  World world;
  Program program(std::span(data, size));
  for (std::size_t steps = 0; !program.over() && steps < kMaxSteps; ++steps)
    world.step(program);
  world.check_that_all_was_answered();
  return 0;
}
