#include "server/experiments/plan_shapes.hpp"

#include <fmt/core.h>

#include <cmath>

#include "plant/math/trig.hpp"
#include "plant/parameters/parameters.hpp"
#include "protocols/text.hpp"
#include "server/bench/terminals.hpp"

namespace drivebench {
namespace {

constexpr double kMaxPhaseRad = 1e3;
constexpr double kMaxShapeS = 1e6;

/// Checks one shape; refusals name its place in the request.
class ShapeReader {
 public:
  ShapeReader(const v1::Shape& shape, std::string field, const TableLookup& tables,
              const ExperimentPlan& plan)
      : shape_(shape), field_(std::move(field)), tables_(tables), plan_(plan) {}

  InputShape read() {
    const double period_s = plan_.period_s();
    const double start_s = within(shape_.start_s(), 0.0, kMaxShapeS, "s", "start_s");
    const double end_s = within(shape_.end_s(), 0.0, kMaxShapeS, "s", "end_s");
    InputShape result{.channel = InputChannel::kA,
                      .start = static_cast<Tick>(std::round(start_s / period_s)),
                      .end = end_s == 0.0 ? plan_.ticks : static_cast<Tick>(std::round(end_s / period_s)),
                      .shape = ConstantShape{0.0}};
    if (result.start >= result.end) {
      refuse(end_s == 0.0 ? "start_s" : "end_s",
             fmt::format("the shape goes from {} to {} s but must last a tick at least", shortest(start_s),
                         shortest(static_cast<double>(result.end) * period_s)));
    }
    result.channel = channel();
    read_kind(result);
    return result;
  }

 private:
  [[noreturn]] void refuse(std::string_view key, const std::string& sentence,
                           v1::RefusalCode code = v1::REFUSAL_OUT_OF_RANGE) const {
    throw BadRequest(code, key.empty() ? field_ : fmt::format("{}.{}", field_, key), sentence);
  }

  double within(double value, double minimum, double maximum, std::string_view unit,
                std::string_view key) const {
    if (value >= minimum && value <= maximum) return value;
    refuse(key,
           fmt::format("{} is {} but must lie between {} and {} {}", key, shortest(value), shortest(minimum),
                       shortest(maximum), unit),
           std::isfinite(value) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE);
  }
  double value(double x, std::string_view key) const {
    return within(x, -kMaxInputValue, kMaxInputValue, unit(), key);
  }
  double phase(double x, std::string_view key) const {
    return within(x, -kMaxPhaseRad, kMaxPhaseRad, "rad", key);
  }
  /// Checks a frequency: samples show at most half the sample rate.
  double frequency(double x, std::string_view key) const {
    return within(x, -0.5 / plan_.period_s(), 0.5 / plan_.period_s(), "Hz, half the sample rate", key);
  }
  std::string_view unit() const { return plan_.input == v1::INPUT_KIND_PHASE_CURRENTS ? "A" : "V"; }

  InputChannel channel() const {
    const bool dq = plan_.input == v1::INPUT_KIND_DQ_VOLTAGES;
    const Terminals terminals = terminals_of(plan_.config.setup.axes[plan_.axis].parameters);
    if (shape_.has_three_phase()) {
      if (dq || terminal_count(terminals.connection) < 2 || shape_.channel() != v1::CHANNEL_UNSPECIFIED) {
        refuse("channel", "three_phase is for all phases of a machine with two or three: no channel, no dq");
      }
      return InputChannel::kPhases;
    }
    switch (shape_.channel()) {
      case v1::CHANNEL_A:
        if (!dq) return InputChannel::kA;
        break;
      case v1::CHANNEL_B:
        if (!dq && terminals.has_b()) return InputChannel::kB;
        break;
      case v1::CHANNEL_C:
        if (!dq && terminals.has_c()) return InputChannel::kC;
        break;
      case v1::CHANNEL_F:
        if (terminals.field) return InputChannel::kField;
        break;
      case v1::CHANNEL_D:
        if (dq) return InputChannel::kD;
        break;
      case v1::CHANNEL_Q:
        if (dq) return InputChannel::kQ;
        break;
      default:
        break;
    }
    const std::string have =
        (dq ? "d, q" : fmt::format("a{}{}", terminals.has_b() ? ", b" : "", terminals.has_c() ? ", c" : "")) +
        (terminals.field ? ", f" : "");
    refuse("channel", fmt::format("channel is {} but this axis and input have {}",
                                  v1::Channel_IsValid(shape_.channel()) ? v1::Channel_Name(shape_.channel())
                                                                        : std::to_string(shape_.channel()),
                                  have));
  }

  void read_kind(InputShape& result) const {
    using Kind = v1::Shape::KindCase;
    switch (shape_.kind_case()) {
      case Kind::kConstant:
        result.shape = ConstantShape{value(shape_.constant().value(), "constant.value")};
        return;
      case Kind::kRamp:
        result.shape = RampShape{.from = value(shape_.ramp().from(), "ramp.from"),
                                 .to = value(shape_.ramp().to(), "ramp.to")};
        return;
      case Kind::kSine:
        result.shape = SineShape{.amplitude = value(shape_.sine().amplitude(), "sine.amplitude"),
                                 .frequency_hz = frequency(shape_.sine().frequency_hz(), "sine.frequency_hz"),
                                 .phase_rad = phase(shape_.sine().phase_rad(), "sine.phase_rad"),
                                 .offset = value(shape_.sine().offset(), "sine.offset")};
        return;
      case Kind::kThreePhase: {
        const v1::Shape::ThreePhase& s = shape_.three_phase();
        result.shape =
            ThreePhaseShape{.amplitude = value(s.amplitude(), "three_phase.amplitude"),
                            .frequency_hz = frequency(s.frequency_hz(), "three_phase.frequency_hz"),
                            .phase_rad = phase(s.phase_rad(), "three_phase.phase_rad"),
                            .rise_s = within(s.rise_s(), 0.0, kMaxShapeS, "s", "three_phase.rise_s")};
        return;
      }
      case Kind::kChirp:
        result.shape = ChirpShape{.amplitude = value(shape_.chirp().amplitude(), "chirp.amplitude"),
                                  .from_hz = frequency(shape_.chirp().from_hz(), "chirp.from_hz"),
                                  .to_hz = frequency(shape_.chirp().to_hz(), "chirp.to_hz")};
        return;
      case Kind::kPrbs:
        result.shape = prbs(shape_.prbs());
        return;
      case Kind::kMultisine:
        result.shape = multisine(shape_.multisine());
        return;
      case Kind::kTable:
        result.shape = table(shape_.table());
        return;
      case Kind::KIND_NOT_SET:
        break;
    }
    refuse({}, "a shape must be one of constant, ramp, sine, three_phase, chirp, prbs, multisine and table");
  }

  PrbsShape prbs(const v1::Shape::Prbs& s) const {
    const auto order =
        static_cast<std::uint32_t>(within(s.order(), kMinPrbsOrder, kMaxPrbsOrder, "bits", "prbs.order"));
    const std::vector<bool>& bits = maximum_length_sequence(order);
    return {.amplitude = value(s.amplitude(), "prbs.amplitude"),
            .bit_ticks = std::max(static_cast<Tick>(s.bit_ticks()), Tick{1}),
            .first_bit = s.seed() % bits.size(),
            .bits = &bits};
  }

  MultisineShape multisine(const v1::Shape::Multisine& s) const {
    within(s.harmonics_size(), 1, kMaxHarmonics, "harmonics", "multisine.harmonics");
    const double base_hz = within(s.base_hz(), 1e-6, 0.5 / plan_.period_s(), "Hz", "multisine.base_hz");
    for (const std::uint32_t harmonic : s.harmonics()) {
      if (harmonic == 0) refuse("multisine.harmonics", "a harmonic is 0 but the first is 1");
      frequency(harmonic * base_hz, "multisine.harmonics");
    }
    return {.amplitude = value(s.amplitude(), "multisine.amplitude"),
            .base_hz = base_hz,
            .harmonics = {s.harmonics().begin(), s.harmonics().end()}};
  }

  TableShape table(const v1::Shape::Table& s) const {
    const std::shared_ptr<const SignalTable> rows = tables_(s.id());
    if (rows == nullptr) {
      refuse("table.id", fmt::format("this session has no table {}", s.id()), v1::REFUSAL_UNKNOWN_TABLE);
    }
    if (rows->size() == 0) refuse("table.id", fmt::format("table {} has no rows", s.id()));
    return {.table = std::make_shared<const TableView>(*rows), .interpolate = s.interpolate()};
  }

  const v1::Shape& shape_;
  std::string field_;
  const TableLookup& tables_;
  const ExperimentPlan& plan_;
};

[[noreturn]] void refuse_input(const std::string& field, const std::string& sentence,
                               v1::RefusalCode code = v1::REFUSAL_OUT_OF_RANGE) {
  throw BadRequest(code, "input." + field, sentence);
}

void read_angle(const v1::ExperimentInput& input, ExperimentPlan& plan) {
  const AxisParameters& p = plan.config.setup.axes[plan.axis].parameters;
  const Parameter* const pole_pairs = find_parameter(p, "machine.pole_pairs");
  if (pole_pairs == nullptr || plan.connection == Connection::kArmature) {
    refuse_input("kind", "this machine has no dq axes", v1::REFUSAL_WRONG_DRIVE);
  }
  if (input.angle() != v1::ANGLE_SOURCE_TRUE && input.angle() != v1::ANGLE_SOURCE_MEASURED) {
    refuse_input("angle", "dq voltages need an angle: true or measured");
  }
  plan.dq.is_measured = input.angle() == v1::ANGLE_SOURCE_MEASURED;
  plan.dq.pole_pairs = pole_pairs->get(p);
  plan.dq.rad_per_count = kTurnRad / static_cast<double>(p.encoder.counts_per_revolution);
  plan.dq.offset_counts = p.encoder.half_count_offset ? 0.0 : 0.5;
  plan.dq.back_emf_vs = input.back_emf_vs();
  if (!(std::abs(input.back_emf_vs()) <= kMaxInputValue)) {
    refuse_input(
        "back_emf_vs",
        fmt::format("back_emf_vs is {} but must lie between -1e6 and 1e6 V*s", shortest(input.back_emf_vs())),
        std::isfinite(input.back_emf_vs()) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE);
  }
  if (plan.dq.is_measured && input.back_emf_vs() != 0.0) {
    refuse_input("back_emf_vs", "back_emf_vs must be 0 with a measured angle: it goes by the true speed");
  }
}

void check_kind(const v1::ExperimentInput& input, const ExperimentPlan& plan) {
  const DriveKind drive = plan.config.setup.axes[plan.axis].parameters.drive.kind;
  if (input.kind() <= v1::INPUT_KIND_UNSPECIFIED || input.kind() > v1::INPUT_KIND_DQ_VOLTAGES) {
    refuse_input("kind", "input.kind must be none, source, phase_voltages, phase_currents or dq_voltages");
  }
  if (input.kind() == v1::INPUT_KIND_SOURCE && drive != DriveKind::kSource) {
    refuse_input("kind", "input.kind is source but the drive of this axis is none", v1::REFUSAL_WRONG_DRIVE);
  }
  if (input.kind() == v1::INPUT_KIND_PHASE_CURRENTS && drive != DriveKind::kCurrent) {
    refuse_input("kind", "input.kind is phase_currents but the drive of this axis has no current loop",
                 v1::REFUSAL_WRONG_DRIVE);
  }
  if (plan.has_commands() && plan.config.setup.axes[plan.axis].shares_amplifier_with) {
    refuse_input("kind", std::string(sentence_of(Refused::kSharedAmplifier)), v1::REFUSAL_SHARED_AMPLIFIER);
  }
  if (plan.has_commands() && drive == DriveKind::kSource) {
    refuse_input("kind", "the drive of this axis is a source, which takes no commands",
                 v1::REFUSAL_WRONG_DRIVE);
  }
  if (!plan.has_commands() && !input.shapes().empty()) {
    refuse_input("shapes", "this input.kind takes no commands, so there must be no shapes");
  }
  if (input.kind() != v1::INPUT_KIND_DQ_VOLTAGES &&
      (input.angle() != v1::ANGLE_SOURCE_UNSPECIFIED || input.back_emf_vs() != 0.0)) {
    refuse_input("angle", "angle and back_emf_vs belong to dq voltages only");
  }
}

}  // namespace

void add_input(const v1::ExperimentInput& input, const TableLookup& tables, ExperimentPlan& plan) {
  plan.input = input.kind();
  check_kind(input, plan);
  if (input.kind() == v1::INPUT_KIND_DQ_VOLTAGES) read_angle(input, plan);
  if (input.shapes_size() > kMaxShapes) {
    refuse_input("shapes",
                 fmt::format("there are {} shapes but there may be {}", input.shapes_size(), kMaxShapes));
  }
  int harmonics = 0;
  for (int i = 0; i < input.shapes_size(); ++i) {
    harmonics += input.shapes(i).multisine().harmonics_size();
    if (harmonics > kMaxHarmonics) {
      refuse_input("shapes", fmt::format("there are more than {} harmonics in all shapes", kMaxHarmonics));
    }
    plan.shapes.push_back(
        ShapeReader(input.shapes(i), fmt::format("input.shapes[{}]", i), tables, plan).read());
  }
}

PhaseCommand command_of(const ExperimentPlan& plan, const Sample& sample, Tick tick) noexcept {
  InputValues values{};
  for (const InputShape& shape : plan.shapes)
    add_shape(shape, tick, plan.period_s(), plan.connection, values);
  const auto at = [&values](InputChannel channel) { return values[static_cast<std::size_t>(channel)]; };
  PhaseCommand command{.gates = Gates::kVoltage, .setpoint = {.field = at(InputChannel::kField)}};
  if (plan.input != v1::INPUT_KIND_DQ_VOLTAGES) {
    if (plan.input == v1::INPUT_KIND_PHASE_CURRENTS) command.gates = Gates::kCurrent;
    command.setpoint.a = at(InputChannel::kA);
    command.setpoint.b = at(InputChannel::kB);
    command.setpoint.c = at(InputChannel::kC);
    return command;
  }
  const double angle_rad =
      plan.dq.is_measured
          ? (static_cast<double>(sample.encoder_count) + plan.dq.offset_counts) * plan.dq.rad_per_count
          : sample.angle_rad;
  const TwoPhase u =
      to_ab({.d = at(InputChannel::kD), .q = at(InputChannel::kQ) + plan.dq.back_emf_vs * sample.speed_rad_s},
            cos_sin(plan.dq.pole_pairs * angle_rad));
  if (plan.connection == Connection::kTwoPhase) {
    command.setpoint.a = u.a;
    command.setpoint.b = u.b;
  } else {
    const ThreePhase phases = two_to_three(u);
    command.setpoint.a = phases.a;
    command.setpoint.b = phases.b;
    command.setpoint.c = phases.c;
  }
  return command;
}

}  // namespace drivebench
