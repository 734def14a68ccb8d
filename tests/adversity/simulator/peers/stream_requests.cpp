// The requests of a client.
#include <array>
#include <cmath>
#include <limits>

#include "plant/injected_faults.hpp"
#include "plant/parameters/parameters.hpp"
#include "tests/adversity/simulator/peers/stream_client.hpp"
#include "tests/fuzz/request_program.hpp"

namespace drivebench::simulator {
namespace {

constexpr auto kWild =
    std::to_array<double>({std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                           -1e308, 1e9, 5e-324, -1e6, 1e300});

std::string framed(const std::string& payload) {
  const auto header = frame_header(static_cast<std::uint32_t>(payload.size()));
  return std::string(reinterpret_cast<const char*>(header.data()), header.size()) + payload;
}

}  // namespace

double StreamClient::value(double usual) {
  return random_.chance(manners_.wild) ? random_.pick(std::span(kWild)) : random_.real(-usual, usual);
}

std::uint64_t StreamClient::ask(v1::Envelope& request, std::uint32_t axis, bool counts) {
  request.set_id(++last_id_);
  const std::uint64_t tick = counts ? request.exchange().commands(0).tick() : 0;
  asked_[last_id_] = {request.kind_case(),
                      axis,
                      request.lease().action(),
                      counts,
                      tick,
                      counts ? scene_.axes[axis].tick() : 0,
                      request.has_lease() ? scene_.axes[axis].forces() : 0};
  send(request);
  return last_id_;
}

void StreamClient::send(const v1::Envelope& request) {
  scene_.note("asks", number_, static_cast<std::uint64_t>(request.kind_case()), request.id());
  wire_->send(framed(request.SerializeAsString()));
}

void StreamClient::control_later() {
  if (control_due_) return;
  control_due_ = true;
  scene_.schedule.after(manners_.think + random_.between(0, manners_.think / 4),
                        [this, connection = connection_] {
                          control_due_ = false;
                          if (connection == connection_ && wire_->is_open() && greeted_) control();
                        });
}

/// The next step of a controller: the lease, the fault, the command.
void StreamClient::control() {
  if (scene_.ending) return;
  if (!leased_[own_axis_]) {
    const bool asks = std::ranges::any_of(
        asked_, [](const auto& each) { return each.second.kind == v1::Envelope::kLease; });
    return asks ? void() : lease(own_axis_, v1::LeaseRequest::ACTION_ACQUIRE);
  }
  if (latched_[own_axis_] && random_.chance(0.5)) return clear(own_axis_);
  if (random_.chance(manners_.lost)) return control_later();
  command(own_axis_);
  if (random_.chance(manners_.twice)) command(own_axis_);
}

void StreamClient::command(std::uint32_t axis) {
  v1::Envelope request;
  v1::Command& c = *request.mutable_exchange()->add_commands();
  const Engine& engine = *scene_.engine;
  std::int64_t tick = static_cast<std::int64_t>(newest_[axis]);
  if (random_.chance(manners_.wrong_tick)) tick += random_.between(-20, 20);
  c.set_axis(axis);
  c.set_tick(static_cast<std::uint64_t>(std::max<std::int64_t>(tick, 0)));
  const bool current = engine.parameters(axis).drive.kind == DriveKind::kCurrent;
  c.set_gates(latched_[axis]         ? v1::GATES_OFF
              : random_.chance(0.02) ? v1::GATES_ZERO
              : current              ? v1::GATES_CURRENT
                                     : v1::GATES_VOLTAGE);
  c.set_u_a_v(value(10.0));
  c.set_u_b_v(value(10.0));
  c.set_i_a_a(value(1.0));
  c.set_i_b_a(value(1.0));
  scene_.axes[axis].command_sent(owner_, static_cast<Tick>(c.tick()));
  ask(request, axis, true);
}

void StreamClient::lease(std::uint32_t axis, v1::LeaseRequest::Action action) {
  v1::Envelope request;
  request.mutable_lease()->set_axis(axis);
  request.mutable_lease()->set_action(action);
  if (action == v1::LeaseRequest::ACTION_RELEASE) scene_.axes[axis].may_go(owner_);
  if (action == v1::LeaseRequest::ACTION_TAKE) {
    request.mutable_lease()->set_reason("it was my turn");
    scene_.axes[axis].force_begins();
  }
  // An exchange that waits for a tick of this axis is then refused without being counted.
  if (action == v1::LeaseRequest::ACTION_RELEASE) {
    for (auto& [id, asked] : asked_)
      asked.counts = asked.counts && asked.axis != axis;
  }
  ask(request, axis);
}

void StreamClient::clear(std::uint32_t axis) {
  v1::Envelope request;
  request.mutable_clear_faults()->set_axis(axis);
  ask(request, axis);
}

void StreamClient::change(std::uint32_t axis) {
  v1::Envelope request;
  const auto now = static_cast<std::uint64_t>(scene_.engine->tick());
  const std::uint64_t at_tick = random_.chance(0.5) ? 0 : now + random_.below(2000);
  const std::uint64_t ramp = random_.chance(0.7) ? 0 : random_.below(1000);
  switch (random_.below(4)) {
    case 0: {
      v1::SetLoad& load = *request.mutable_set_load();
      load.set_axis(axis);
      load.set_load_nm(value(0.3));
      load.set_ramp_ticks(ramp);
      load.set_at_tick(at_tick);
      break;
    }
    case 1: {
      const auto rows = axis_parameters(scene_.engine->parameters(axis));
      const Parameter& row = rows[random_.below(rows.size())];
      v1::WriteParameter& write = *request.mutable_write_parameter();
      write.set_axis(axis);
      write.set_name(std::string(row.name));
      const double in_force = row.get(scene_.engine->parameters(axis));
      write.set_value(random_.chance(manners_.wild) ? value(1.0) : in_force * random_.real(0.8, 1.25));
      write.set_ramp_ticks(ramp);
      write.set_at_tick(at_tick);
      break;
    }
    case 2: {
      const InjectableFault& fault = random_.pick(std::span(kInjectableFaults));
      v1::InjectFault& inject = *request.mutable_inject_fault();
      inject.set_axis(axis);
      inject.set_name(std::string(fault.name));
      inject.set_value(random_.chance(0.5) ? 0.0 : value(1.0));
      inject.set_at_tick(at_tick);
      break;
    }
    default:
      request.mutable_shaft_bump()->set_axis(axis);
      request.mutable_shaft_bump()->set_impulse_nms(value(1e-4));
      request.mutable_shaft_bump()->set_at_tick(at_tick);
      break;
  }
  scene_.axes[axis].scheduled();
  ask(request, axis);
}

void StreamClient::ask_something(std::uint32_t axis) {
  v1::Envelope request;
  switch (random_.below(4)) {
    case 0:
      request.mutable_status_request();
      break;
    case 1:
      request.mutable_read_parameters()->set_axis(random_.chance(0.1) ? 99 : axis);
      break;
    case 2:
      request.mutable_run_experiment();
      break;
    default:
      request.mutable_exchange();
      break;
  }
  ask(request, axis);
}

/// Bytes without a meaning, a frame without an Envelope, one that is too long, or half a request.
void StreamClient::babble() {
  raw_ = true;
  std::string bytes(1 + random_.below(random_.chance(0.1) ? 20'000 : 60), '\0');
  for (char& byte : bytes)
    byte = static_cast<char>(random_.below(256));
  if (random_.chance(0.5)) bytes = framed(bytes);
  if (random_.chance(0.2)) bytes = framed(bytes).substr(0, 1 + random_.below(bytes.size()));
  scene_.note("babbles", number_, bytes.size());
  for (AxisAccount& axis : scene_.axes) {
    axis.command_sent();
    axis.clear_unanswered();
    axis.may_go(owner_);  // the bench may end the session, and run a tick before it closes the socket
  }
  wire_->send(bytes);
}

/// A frame from which a parser without bounds makes 3 to 14 MB.
void StreamClient::gorge() {
  using fuzz::wire::repeated;
  using fuzz::wire::tagged;
  const std::string empty = fuzz::wire::varint(0);
  const std::string harmonics = tagged(1, 2, tagged(1, 2, tagged(4, 2, "")));
  const std::array<std::string, 6> frames{
      tagged(v1::Envelope::kSamples, 2, repeated(tagged(3, 2, ""), 32'000)),
      tagged(v1::Envelope::kExchange, 2, repeated(tagged(1, 2, ""), 30'000)),
      tagged(v1::Envelope::kSubscribe, 2, repeated(tagged(3, 2, ""), 30'000)),
      repeated(tagged(v1::Envelope::kRunExperiment, 2, harmonics), 5'000),
      repeated(tagged(v1::Envelope::kLease, 2, "") + tagged(v1::Envelope::kSubscribe, 2, ""), 15'000),
      tagged(v1::Envelope::kStatusRequest, 2, "") + repeated(tagged(2000, 0, empty), 21'000),
  };
  const std::uint64_t which = random_.below(frames.size());
  asked_[++last_id_] = {};
  scene_.note("gorges", number_, which, last_id_);
  wire_->send(framed(tagged(1, 0, fuzz::wire::varint(last_id_)) + frames[which]));
}

}  // namespace drivebench::simulator
