#include "server/recording/input_codec.hpp"

#include <algorithm>
#include <cmath>

#include "server/bench/multisine.hpp"

namespace drivebench {
namespace {

// Gates, lease actions, modes and quantities have the same numbers here and on the wire.
static_assert(static_cast<int>(Gates::kOff) == v1::GATES_OFF);
static_assert(static_cast<int>(Gates::kVoltage) == v1::GATES_VOLTAGE);
static_assert(static_cast<int>(Gates::kZeroVoltage) == v1::GATES_ZERO);
static_assert(static_cast<int>(Gates::kCurrent) == v1::GATES_CURRENT);
static_assert(static_cast<int>(Gates::kDuty) == v1::GATES_DUTY);
static_assert(static_cast<int>(Gates::kEdges) == v1::GATES_EDGES);
static_assert(static_cast<int>(LegLevel::kOff) == v1::LEG_LEVEL_OFF);
static_assert(static_cast<int>(LegLevel::kLow) == v1::LEG_LEVEL_LOW);
static_assert(static_cast<int>(LegLevel::kHigh) == v1::LEG_LEVEL_HIGH);
static_assert(static_cast<int>(LeaseAction::kAcquire) == v1::LeaseRequest::ACTION_ACQUIRE);
static_assert(static_cast<int>(LeaseAction::kLost) == v1::LeaseRequest::ACTION_LOST);
static_assert(static_cast<int>(Multisine::Quantity::kLoad) == v1::Multisine::QUANTITY_LOAD);
static_assert(static_cast<int>(Multisine::Quantity::kCurrentOffset) ==
              v1::Multisine::QUANTITY_CURRENT_OFFSET);

void write_edges(const LegEdgeList& list, google::protobuf::RepeatedPtrField<v1::LegEdge>& out) {
  for (const LegEdge& edge : list) {
    if (edge.level() == LegLevel::kNone) break;
    v1::LegEdge& added = *out.Add();
    added.set_offset_ns(edge.offset_ns());
    added.set_level(static_cast<v1::LegLevel>(edge.level()));
  }
}

struct ActionWriter {
  v1::Input& message;
  const ParameterTables& tables;

  void operator()(const Command& c) const {
    v1::Command& out = *message.mutable_command();
    out.set_tick(static_cast<std::uint64_t>(c.answers));
    out.set_gates(static_cast<v1::Gates>(c.phases.gates));
    const PhaseValues& x = c.phases.setpoint;
    out.set_legs_off(c.phases.legs_off);
    if (c.phases.gates == Gates::kCurrent) {
      out.set_i_a_a(x.a);
      out.set_i_b_a(x.b);
      out.set_i_c_a(x.c);
      out.set_i_f_a(x.field);
    } else if (c.phases.gates == Gates::kEdges) {
      out.set_d_f(x.field);
      write_edges(c.phases.edges[0], *out.mutable_edges_a());
      write_edges(c.phases.edges[1], *out.mutable_edges_b());
      write_edges(c.phases.edges[2], *out.mutable_edges_c());
    } else if (c.phases.gates == Gates::kDuty) {
      out.set_d_a(x.a);
      out.set_d_b(x.b);
      out.set_d_c(x.c);
      out.set_d_f(x.field);
    } else {
      out.set_u_a_v(x.a);
      out.set_u_b_v(x.b);
      out.set_u_c_v(x.c);
      out.set_u_f_v(x.field);
    }
  }
  void operator()(const LeaseAction& action) const {
    message.set_lease(static_cast<v1::LeaseRequest::Action>(action));
  }
  void operator()(const LoadChange& change) const {
    message.mutable_load()->set_load_nm(change.load_nm);
    message.mutable_load()->set_ramp_ticks(static_cast<std::uint64_t>(change.ramp_ticks));
  }
  void operator()(const ParameterWrite& write) const {
    message.mutable_parameter()->set_name(std::string(tables[message.axis()][write.row].name));
    message.mutable_parameter()->set_value(write.value);
    message.mutable_parameter()->set_ramp_ticks(static_cast<std::uint64_t>(write.ramp_ticks));
  }
  void operator()(const InjectFault& fault) const {
    message.mutable_inject()->set_name(std::string(kInjectableFaults[fault.row].name));
    message.mutable_inject()->set_value(fault.value);
  }
  void operator()(const ShaftBump& bump) const { message.mutable_bump()->set_impulse_nms(bump.impulse_nms); }
  void operator()(const Multisine& m) const {
    v1::Multisine& out = *message.mutable_multisine();
    out.set_quantity(static_cast<v1::Multisine::Quantity>(m.quantity));
    out.set_amplitude(m.amplitude);
    out.set_period_ticks(m.lines.period_ticks);
    out.set_periods(m.periods);
    out.set_lowest(m.lines.lowest);
    out.set_highest(m.lines.highest);
    out.set_ratio(m.lines.ratio);
  }
  void operator()(const ClearFaults&) const { message.set_clear(true); }
  void operator()(const LateTick&) const { message.set_late_tick(true); }
  void operator()(const Overrun&) const { message.set_overrun(true); }
  void operator()(const RefusedCommand& refused) const { message.set_refused_command(refused.bad_values); }
};

std::optional<ParameterWrite> decode_write(const v1::WriteParameter& message,
                                           std::span<const Parameter> parameters) {
  const auto row = std::find_if(parameters.begin(), parameters.end(),
                                [&](const Parameter& p) { return p.name == message.name(); });
  if (row == parameters.end() || !row->live || !problem_with(*row, message.value()).empty()) {
    return std::nullopt;
  }
  if (message.ramp_ticks() > kMaxTick || (row->integer && message.ramp_ticks() != 0)) return std::nullopt;
  return ParameterWrite{.row = static_cast<std::uint32_t>(row - parameters.begin()),
                        .value = message.value(),
                        .ramp_ticks = static_cast<Tick>(message.ramp_ticks())};
}

std::optional<InjectFault> decode_fault(const v1::InjectFault& message) {
  const std::size_t row = find_injectable_fault(message.name());
  if (row == kInjectableFaultCount) return std::nullopt;
  if (!problem_with(kInjectableFaults[row], message.value()).empty()) return std::nullopt;
  return InjectFault{.row = static_cast<std::uint32_t>(row), .value = message.value()};
}

std::optional<Multisine> decode_multisine(const v1::Multisine& message) {
  if (!v1::Multisine::Quantity_IsValid(message.quantity())) return std::nullopt;
  const Multisine multisine{.quantity = static_cast<Multisine::Quantity>(message.quantity()),
                            .periods = message.periods(),
                            .amplitude = message.amplitude(),
                            .lines = {.period_ticks = message.period_ticks(),
                                      .lowest = message.lowest(),
                                      .highest = message.highest(),
                                      .ratio = message.ratio()}};
  if (!is_possible(multisine)) return std::nullopt;
  return multisine;
}

}  // namespace

ParameterTables parameter_tables(const BenchSetup& setup) {
  ParameterTables tables;
  for (const AxisSetup& axis : setup.axes)
    tables.push_back(axis_parameters(axis.parameters));
  return tables;
}

void encode_input(Tick received, const Input& input, const ParameterTables& tables, v1::Input& message) {
  message.Clear();
  message.set_tick(static_cast<std::uint64_t>(input.tick));
  message.set_received_tick(static_cast<std::uint64_t>(received));
  message.set_axis(input.axis);
  message.set_owner(input.owner);
  std::visit(ActionWriter{message, tables}, input.action);
}

EdgeProblem read_edges(const v1::Command& message, EdgeRecords& edges) {
  const std::array lists{&message.edges_a(), &message.edges_b(), &message.edges_c()};
  for (std::size_t leg = 0; leg < lists.size(); ++leg) {
    const auto count = static_cast<std::size_t>(lists[leg]->size());
    if (count > kMaxLegEdges) return too_many_edges(leg, count);
    std::ranges::transform(*lists[leg], edges[leg].begin(), [](const v1::LegEdge& edge) {
      return EdgeRecord{.offset_ns = edge.offset_ns(), .level = static_cast<std::uint32_t>(edge.level())};
    });
  }
  return {};
}

PhaseValues setpoint_of(const v1::Command& m) {
  if (m.gates() == v1::GATES_CURRENT)
    return {.a = m.i_a_a(), .b = m.i_b_a(), .c = m.i_c_a(), .field = m.i_f_a()};
  if (m.gates() == v1::GATES_DUTY) return {.a = m.d_a(), .b = m.d_b(), .c = m.d_c(), .field = m.d_f()};
  if (m.gates() == v1::GATES_EDGES) return {.field = m.d_f()};
  return {.a = m.u_a_v(), .b = m.u_b_v(), .c = m.u_c_v(), .field = m.u_f_v()};
}

namespace {

std::optional<Command> decode_command(const v1::Command& message) {
  if (!v1::Gates_IsValid(message.gates()) || message.legs_off() > kAllLegs) return std::nullopt;
  EdgeRecords edges{};
  if (message.gates() == v1::GATES_EDGES && !read_edges(message, edges).sentence.empty()) return std::nullopt;
  if (!problem_with(edges, std::int64_t{kMaxOffsetNs} + 1).sentence.empty()) return std::nullopt;
  return Command{.answers = static_cast<Tick>(message.tick()),
                 .phases = {.gates = static_cast<Gates>(message.gates()),
                            .legs_off = message.legs_off(),
                            .setpoint = setpoint_of(message),
                            .edges = leg_edges(edges)}};
}

}  // namespace

std::optional<Input> decode_input(const v1::Input& message, const ParameterTables& tables) {
  Input input{.tick = static_cast<Tick>(message.tick()),
              .axis = message.axis(),
              .owner = message.owner(),
              .action = {}};
  switch (message.action_case()) {
    case v1::Input::kCommand: {
      const std::optional<Command> command = decode_command(message.command());
      if (!command) return std::nullopt;
      input.action = *command;
      return input;
    }
    case v1::Input::kLease:
      if (!v1::LeaseRequest::Action_IsValid(message.lease())) return std::nullopt;
      input.action = static_cast<LeaseAction>(message.lease());
      return input;
    case v1::Input::kLoad:
      if (!std::isfinite(message.load().load_nm())) return std::nullopt;
      input.action = LoadChange{message.load().load_nm(), static_cast<Tick>(message.load().ramp_ticks())};
      return input;
    case v1::Input::kParameter: {
      if (input.axis >= tables.size()) return std::nullopt;
      const auto write = decode_write(message.parameter(), tables[input.axis]);
      if (!write) return std::nullopt;
      input.action = *write;
      return input;
    }
    case v1::Input::kInject: {
      const auto fault = decode_fault(message.inject());
      if (!fault) return std::nullopt;
      input.action = *fault;
      return input;
    }
    case v1::Input::kBump:
      if (!std::isfinite(message.bump().impulse_nms())) return std::nullopt;
      input.action = ShaftBump{message.bump().impulse_nms()};
      return input;
    case v1::Input::kMultisine: {
      const auto multisine = decode_multisine(message.multisine());
      if (!multisine) return std::nullopt;
      input.action = *multisine;
      return input;
    }
    case v1::Input::kClear:
      input.action = ClearFaults{};
      return input;
    case v1::Input::kLateTick:
      input.action = LateTick{};
      return input;
    case v1::Input::kOverrun:
      input.action = Overrun{};
      return input;
    case v1::Input::kRefusedCommand:
      input.action = RefusedCommand{.bad_values = message.refused_command()};
      return input;
    case v1::Input::ACTION_NOT_SET:
      break;
  }
  return std::nullopt;
}

v1::Mode wire_mode(RunMode mode) noexcept {
  switch (mode) {
    case RunMode::kRealtime:
      return v1::MODE_REALTIME;
    case RunMode::kLockstep:
      return v1::MODE_LOCKSTEP;
    case RunMode::kFree:
      break;
  }
  return v1::MODE_FREE;
}

void encode_verdict(const Verdict& verdict, v1::Verdict& message) {
  message.set_mode(wire_mode(verdict.mode));
  message.set_ticks(verdict.ticks);
  message.set_exact(verdict.exact());
  message.set_realtime_valid(verdict.realtime_valid());
  message.set_late_ticks(verdict.late_ticks);
  message.set_worst_lateness_s(static_cast<double>(verdict.lateness.worst_ns()) * 1e-9);
  if (verdict.mode == RunMode::kRealtime) {
    for (const std::uint64_t count : verdict.lateness.buckets())
      message.add_lateness_counts(count);
  }
  message.set_gaps(verdict.gaps);
  message.set_state_hash(verdict.state_hash);
  message.set_sentence(verdict.sentence());
}

}  // namespace drivebench
