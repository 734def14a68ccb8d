#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench.pb.h"
#include "protocols/framing.hpp"
#include "tests/adversity/simulator/world/scene.hpp"
#include "tests/adversity/simulator/world/wire.hpp"

namespace drivebench::simulator {

/// The behaviour of a client. Chances are per turn, unless they say something else.
struct Manners {
  const char* name = "";
  const char* token = "";
  Quality quality{};
  Time begins = 0;
  Time turn = 20 * kMillisecond;  ///< time between its turns
  Time read_every = 3 * kMillisecond;
  std::size_t read_most = 65536;  ///< bytes at a time
  Time think = kMillisecond;      ///< between an answer and the next command
  bool greets = true;
  bool controls = false;  ///< takes an axis and commands it
  double takes = 0.0;     ///< asks for some axis
  double gives = 0.0;     ///< releases its axis
  double forces = 0.0;    ///< takes an axis by force
  double steals = 0.0;    ///< commands an axis of another owner
  double clears = 0.0;
  double changes = 0.0;  ///< load, parameter, fault, bump
  double asks = 0.0;     ///< status, parameters, newest samples
  double wild = 0.0;     ///< of commands and changes: with absurd values
  double lost = 0.0;     ///< of commands: never sent
  double twice = 0.0;    ///< of commands
  double wrong_tick = 0.0;
  double babbles = 0.0;     ///< sends random bytes
  double gorges = 0.0;      ///< sends a frame whose message would take megabytes
  double stops = 0.0;       ///< its network stands still for up to 3 s
  double leaves = 0.0;      ///< disconnects without a release
  double shuts = 0.0;       ///< closes its sending side
  std::uint32_t every = 0;  ///< ticks; subscribes to samples; 0: not
  bool gets_all = false;    ///< and may lose none
  bool gets_in = false;     ///< the server must give it a session within seconds, beside any crowd
};

/// A client on the stream socket: a controller, a viewer, or a nuisance.
class StreamClient final : public Player {
 public:
  StreamClient(Scene& scene, std::uint64_t number, const Manners& manners);

  void start() override { take_turn(); }
  void finish() override;
  void check_end() override;
  void leave() override { disconnect("leaves"); }
  bool has_session() const override { return wire_ && wire_->is_connected(); }

 private:
  struct Asked {
    v1::Envelope::KindCase kind;
    std::uint32_t axis;  ///< commanded, leased or cleared
    v1::LeaseRequest::Action action;
    bool counts;           ///< a command for one axis, that is counted if it is refused
    std::uint64_t tick;    ///< that a command answers
    std::uint64_t sent;    ///< tick of the axis when a command was sent
    std::uint64_t forces;  ///< AxisAccount::forces() when a lease was asked for
  };
  struct Subscription {
    std::uint32_t every = 0;
    std::uint64_t last = 0;  ///< tick up to which samples came
  };

  void take_turn();
  void act();
  void nag();
  void connect();
  void disconnect(const char* how);
  void forget();
  void read();
  void on_frame(std::span<const std::byte> frame);
  void on_last_look(std::uint64_t sessions);
  void on_done(const Asked& asked, const v1::Done& done);
  void on_refusal(const Asked& asked, const v1::Refusal& refusal);
  void on_samples(const v1::Samples& samples);
  void see(std::uint32_t axis, const v1::Sample& sample);
  void is_told(std::uint32_t axis, const v1::Sample& sample, bool in_status = false);

  void control();
  void control_later();
  void command(std::uint32_t axis);
  void change(std::uint32_t axis);
  void ask_something(std::uint32_t axis);
  void lease(std::uint32_t axis, v1::LeaseRequest::Action action);
  void clear(std::uint32_t axis);
  void babble();
  void gorge();
  std::uint64_t ask(v1::Envelope& request, std::uint32_t axis = 0, bool counts = false);
  bool asks_for_lease(std::uint32_t axis) const;
  void send(const v1::Envelope& request);
  double value(double usual);
  std::uint32_t some_axis() { return static_cast<std::uint32_t>(random_.below(scene_.axes.size())); }
  std::size_t axis_count() const { return scene_.axes.size(); }

  Scene& scene_;
  std::uint64_t number_;
  Manners manners_;
  Random random_;
  std::uint32_t own_axis_;

  std::shared_ptr<Wire> wire_;
  std::uint64_t connection_ = 0;  ///< number of the present one
  Time connected_at_ = 0;
  std::optional<Time> outside_since_;  ///< in times of Scene::awake(); none: it has a session
  std::optional<FrameReader> reader_;
  bool greeted_ = false;
  bool raw_ = false;  ///< it sent random bytes: its state at the server is unknown
  bool control_due_ = false;
  Owner owner_ = 0;
  std::vector<bool> leased_;
  std::vector<std::uint64_t> newest_;  ///< tick, by axis
  std::vector<bool> latched_;          ///< by axis, from the newest sample
  std::vector<Subscription> samples_;  ///< by axis
  std::map<std::uint64_t, Asked> asked_;
  std::uint64_t forbidden_ = 0;  ///< of its requests, in all its sessions
  std::uint64_t last_id_ = 0;
  std::uint64_t last_look_ = 0;  ///< id of the last request for the status
  std::size_t sessions_when_asked_ = 0;
  v1::Envelope answer_;
};

}  // namespace drivebench::simulator
