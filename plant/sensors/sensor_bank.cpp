#include "plant/sensors/sensor_bank.hpp"

#include <algorithm>
#include <numbers>

#include "plant/faults.hpp"
#include "plant/math/noise.hpp"
#include "plant/math/rounding.hpp"

namespace drivebench {
namespace {

constexpr std::size_t at(Channel c) noexcept {
  return static_cast<std::size_t>(c);
}

/// The place of a tick in the history.
constexpr std::size_t slot_of(Tick tick) noexcept {
  constexpr Tick kSlots = kMaxSensorDelayTicks + 1;
  return static_cast<std::size_t>((tick + kSlots) % kSlots);
}

double between(double from, double to, double fraction) noexcept {
  return from + fraction * (to - from);
}

PhaseValues between(const PhaseValues& from, const PhaseValues& to, double fraction) noexcept {
  return {.a = between(from.a, to.a, fraction),
          .b = between(from.b, to.b, fraction),
          .c = between(from.c, to.c, fraction),
          .field = between(from.field, to.field, fraction)};
}

Measurable between(const Measurable& from, const Measurable& to, double fraction) noexcept {
  return {.current_a = between(from.current_a, to.current_a, fraction),
          .voltage_v = between(from.voltage_v, to.voltage_v, fraction),
          .bus_v = between(from.bus_v, to.bus_v, fraction),
          .neutral_v = between(from.neutral_v, to.neutral_v, fraction),
          .temperature_k = between(from.temperature_k, to.temperature_k, fraction),
          .angle_rad = between(from.angle_rad, to.angle_rad, fraction),
          .speed_rad_s = between(from.speed_rad_s, to.speed_rad_s, fraction)};
}

}  // namespace

SensorBank::SensorBank(const SensorParameters& p, Connection connection, double period_s, std::uint64_t seed,
                       std::uint64_t noise_channel, double step_s, bool has_field) noexcept
    : p_(p),
      connection_(connection),
      period_s_(period_s),
      seed_(seed),
      noise_channel_(noise_channel),
      step_s_(step_s),
      has_field_(has_field) {
  set_parameters(p);
}

void SensorBank::set_channels() noexcept {
  const CurrentSensorParameters& current = p_.current;
  channel(Channel::kCurrentA) = current_channel(current, current.gain_a, current.offset_a_a);
  channel(Channel::kCurrentB) = current_channel(current, current.gain_b, current.offset_b_a);
  channel(Channel::kCurrentC) = current_channel(current, current.gain_c, current.offset_c_a);
  channel(Channel::kCurrentField) = current_channel(current, 1.0, 0.0);
  for (const Channel c : {Channel::kVoltageA, Channel::kVoltageB, Channel::kVoltageC, Channel::kVoltageField})
    channel(c) = p_.voltage;
  channel(Channel::kBus) = p_.bus;
  channel(Channel::kNeutral) = p_.neutral;
  channel(Channel::kTemperature) = p_.temperature;
  channel(Channel::kTachometer) = p_.tachometer.analog;
  channel(Channel::kResolverSine) = channel(Channel::kResolverCosine) = p_.resolver.analog;
  channel(Channel::kResolverSine).offset += p_.resolver.sine_offset_v;
  channel(Channel::kResolverCosine).offset += p_.resolver.cosine_offset_v;

  const int terminals = terminal_count(connection_);
  const auto has_terminal = [&](Channel a, Channel b, Channel c, Channel field) {
    channel(a).enabled = channel(a).enabled && terminals > 0;
    channel(b).enabled = channel(b).enabled && terminals > 1;
    channel(c).enabled = channel(c).enabled && terminals > 2;
    channel(field).enabled = channel(field).enabled && has_field_;
  };
  has_terminal(Channel::kCurrentA, Channel::kCurrentB, Channel::kCurrentC, Channel::kCurrentField);
  has_terminal(Channel::kVoltageA, Channel::kVoltageB, Channel::kVoltageC, Channel::kVoltageField);
}

void SensorBank::set_filter(Section section, const AnalogParameters& p) noexcept {
  Filter& filter = filters_[static_cast<std::size_t>(section)];
  filter.rate_per_s = p.enabled ? 2.0 * std::numbers::pi * p.filter_hz : 0.0;
  filter.usual = first_order_step(filter.rate_per_s * step_s_);
  has_filters_ = has_filters_ || filter.rate_per_s > 0.0;
}

void SensorBank::set_parameters(const SensorParameters& p) noexcept {
  p_ = p;
  set_channels();
  has_filters_ = false;
  set_filter(Section::kCurrent, channel(Channel::kCurrentA));
  set_filter(Section::kVoltage, p.voltage);
  set_filter(Section::kBus, p.bus);
  set_filter(Section::kNeutral, p.neutral);
  set_filter(Section::kTemperature, p.temperature);
  set_filter(Section::kTachometer, p.tachometer.analog);
  set_filter(Section::kResolver, p.resolver.analog);
  half_count_ = 0;
  for (std::size_t n = 0; n < kChannelCount; ++n) {
    if (channels_[n].enabled && channels_[n].delay_ticks == 0.5) half_[half_count_++] = n;
  }
  meter_ticks_ = std::max(1.0, static_cast<double>(floor_to_integer(p.meter.window_s / period_s_ + 0.5)));
}

AnalogValues SensorBank::inputs(const Measurable& x) const noexcept {
  AnalogValues values{x.current_a.a, x.current_a.b, x.current_a.c,  x.current_a.field,
                      x.voltage_v.a, x.voltage_v.b, x.voltage_v.c,  x.voltage_v.field,
                      x.bus_v,       x.neutral_v,   x.temperature_k};
  if (p_.tachometer.analog.enabled) {
    values[at(Channel::kTachometer)] = tachometer_v(p_.tachometer, x.angle_rad, x.speed_rad_s);
  }
  if (p_.resolver.analog.enabled) {
    const ResolverVoltages v = resolver_voltages(p_.resolver, x.angle_rad);
    values[at(Channel::kResolverSine)] = v.sine_v;
    values[at(Channel::kResolverCosine)] = v.cosine_v;
  }
  return values;
}

SensorMemory SensorBank::settled(const Measurable& now, Tick tick) const noexcept {
  SensorMemory m;
  m.filtered = m.half_tick = inputs(now);
  m.history.fill(m.filtered);
  m.tick = tick;
  return m;
}

/// The coefficients of each section for one interval.
class SensorBank::FilterSteps {
 public:
  FilterSteps(const SensorBank& bank, double duration_s) noexcept : bank_(bank), duration_s_(duration_s) {
    const double off_s = duration_s - bank.step_s_;
    is_usual_ = off_s * off_s <= 1e-18 * bank.step_s_ * bank.step_s_;
  }

  bool has(Section section) const noexcept { return filter(section).rate_per_s > 0.0; }

  const FirstOrderStep& of(Section section) noexcept {
    if (is_usual_) return filter(section).usual;
    if (const double rate_per_s = filter(section).rate_per_s; rate_per_s != rate_per_s_) {
      rate_per_s_ = rate_per_s;
      step_ = first_order_step(rate_per_s * duration_s_);
    }
    return step_;
  }

 private:
  const Filter& filter(Section section) const noexcept {
    return bank_.filters_[static_cast<std::size_t>(section)];
  }

  const SensorBank& bank_;
  double duration_s_;
  bool is_usual_;
  double rate_per_s_ = 0.0;  ///< that step_ belongs to
  FirstOrderStep step_{};
};

void SensorBank::filter(SensorMemory& m, double start_s, double duration_s, const Measurable& from,
                        const Measurable& to) const noexcept {
  FilterSteps steps(*this, duration_s);
  const auto lag = [&](Channel c, const FirstOrderStep& step, double x0, double x1) {
    m.filtered[at(c)] = lagged(step, m.filtered[at(c)], x0, x1);
  };
  if (steps.has(Section::kCurrent)) {
    const FirstOrderStep step = steps.of(Section::kCurrent);
    lag(Channel::kCurrentA, step, from.current_a.a, to.current_a.a);
    lag(Channel::kCurrentB, step, from.current_a.b, to.current_a.b);
    lag(Channel::kCurrentC, step, from.current_a.c, to.current_a.c);
    lag(Channel::kCurrentField, step, from.current_a.field, to.current_a.field);
  }
  if (steps.has(Section::kVoltage)) {
    const FirstOrderStep step = steps.of(Section::kVoltage);
    lag(Channel::kVoltageA, step, from.voltage_v.a, to.voltage_v.a);
    lag(Channel::kVoltageB, step, from.voltage_v.b, to.voltage_v.b);
    lag(Channel::kVoltageC, step, from.voltage_v.c, to.voltage_v.c);
    lag(Channel::kVoltageField, step, from.voltage_v.field, to.voltage_v.field);
  }
  if (steps.has(Section::kBus)) lag(Channel::kBus, steps.of(Section::kBus), from.bus_v, to.bus_v);
  if (steps.has(Section::kNeutral)) {
    lag(Channel::kNeutral, steps.of(Section::kNeutral), from.neutral_v, to.neutral_v);
  }
  if (steps.has(Section::kTemperature)) {
    lag(Channel::kTemperature, steps.of(Section::kTemperature), from.temperature_k, to.temperature_k);
  }
  filter_shaft(m, start_s, steps, from, to);
}

/// Within a tick the shaft goes on where the last interval has ended, which saves half of the sines.
void SensorBank::filter_shaft(SensorMemory& m, double start_s, FilterSteps& steps, const Measurable& from,
                              const Measurable& to) const noexcept {
  const auto lag = [&](Channel c, double& end_v, Section section, double x0, double x1) {
    m.filtered[at(c)] = lagged(steps.of(section), m.filtered[at(c)], start_s > 0.0 ? end_v : x0, x1);
    end_v = x1;
  };
  const bool starts = !(start_s > 0.0);
  if (steps.has(Section::kTachometer)) {
    const double x0 = starts ? tachometer_v(p_.tachometer, from.angle_rad, from.speed_rad_s) : 0.0;
    const double x1 = tachometer_v(p_.tachometer, to.angle_rad, to.speed_rad_s);
    lag(Channel::kTachometer, m.shaft_end_v[0], Section::kTachometer, x0, x1);
  }
  if (steps.has(Section::kResolver)) {
    const ResolverVoltages x0 = starts ? resolver_voltages(p_.resolver, from.angle_rad) : ResolverVoltages{};
    const ResolverVoltages x1 = resolver_voltages(p_.resolver, to.angle_rad);
    lag(Channel::kResolverSine, m.shaft_end_v[1], Section::kResolver, x0.sine_v, x1.sine_v);
    lag(Channel::kResolverCosine, m.shaft_end_v[2], Section::kResolver, x0.cosine_v, x1.cosine_v);
  }
}

void SensorBank::keep_middle(SensorMemory& m, const Measurable& middle) const noexcept {
  const AnalogValues x = inputs(middle);
  for (std::size_t k = 0; k < half_count_; ++k) {
    const std::size_t n = half_[k];
    m.half_tick[n] = channels_[n].filter_hz > 0.0 ? m.filtered[n] : x[n];
  }
}

void SensorBank::follow(SensorMemory& m, double start_s, double duration_s, const Measurable& from,
                        const Measurable& to) const noexcept {
  if (p_.meter.enabled) {
    add_interval(m.meter.sums, connection_, duration_s, {from.voltage_v, from.current_a},
                 {to.voltage_v, to.current_a});
  }
  // A node of the substeps that belongs on the middle of the tick may miss it by rounding.
  const double tolerance_s = 1e-9 * period_s_;
  const double middle_s = 0.5 * period_s_;
  const double beyond_s = start_s + duration_s - middle_s;
  const bool has_middle = half_count_ > 0 && start_s < middle_s && beyond_s >= -tolerance_s;
  if (!has_middle) {
    if (has_filters_) filter(m, start_s, duration_s, from, to);
    return;
  }
  const bool ends_there = beyond_s <= tolerance_s;
  const double before_s = ends_there ? duration_s : middle_s - start_s;
  const Measurable middle = ends_there ? to : between(from, to, before_s / duration_s);
  if (has_filters_) filter(m, start_s, before_s, from, middle);
  keep_middle(m, middle);
  if (has_filters_ && !ends_there) filter(m, middle_s, beyond_s, middle, to);
}

void SensorBank::end_tick(SensorMemory& m, const Measurable& now, Tick tick) const noexcept {
  AnalogValues& newest = m.history[slot_of(tick)];
  newest = inputs(now);
  for (std::size_t n = 0; has_filters_ && n < kChannelCount; ++n) {
    if (channels_[n].enabled && channels_[n].filter_hz > 0.0) newest[n] = m.filtered[n];
  }
  m.tick = tick;
  if (!p_.meter.enabled) return;
  m.meter.sums.ticks += 1.0;
  if (m.meter.sums.ticks < meter_ticks_) return;
  m.meter.figures = figures_of(m.meter.sums, connection_);
  m.meter.sums = {};
}

double SensorBank::analog(const SensorMemory& m, Channel c, const Errors& errors, Tick tick) const noexcept {
  const std::size_t n = at(c);
  const AnalogParameters& p = channels_[n];
  const Tick sampled = m.tick - static_cast<Tick>(p.delay_ticks);
  const double x = p.delay_ticks == 0.5 ? m.half_tick[n] : m.history[slot_of(sampled)][n];
  double noise = 0.0;
  if (errors.noise_rms > 0.0) {
    noise = gaussian_noise(seed_, noise_channel_ + n, static_cast<std::uint64_t>(tick));
  }
  return errors.gain * x + errors.offset + errors.noise_rms * noise;
}

AnalogReading SensorBank::read(const SensorMemory& m, Channel c, const Errors& errors,
                               Tick tick) const noexcept {
  const AnalogParameters& p = channels_[at(c)];
  return converted(analog(m, c, errors, tick), p.bits, p.full_scale);
}

Sample SensorBank::readings(const SensorMemory& m, const InjectedFaults& faults, Tick tick) const noexcept {
  Sample s;
  const auto shown = [&](Channel c, const AnalogReading& reading, std::uint64_t& count) {
    if (p_.counts) count = converter_count(reading, channels_[at(c)].bits);
    return reading.value;
  };
  std::uint64_t none = 0;
  const auto current = [&](Channel c, double phase, std::uint64_t& count) {
    const AnalogParameters& p = channels_[at(c)];
    if (!p.enabled) return 0.0;
    if (faults.current_sensor_stuck == phase) return shown(c, {}, count);
    const bool is_phase = c != Channel::kCurrentField;
    const Errors errors{.gain = p.gain * (1.0 + faults.current_sensor_gain),
                        .offset = p.offset + (is_phase ? faults.current_sensor_offset : 0.0),
                        .noise_rms = p.noise_rms + (is_phase ? faults.current_sensor_noise : 0.0)};
    const AnalogReading reading = read(m, c, errors, tick);
    if (reading.saturated) s.faults |= kCurrentSensorSaturated;
    return shown(c, reading, count);
  };
  const auto counted = [&](Channel c, std::uint64_t& count, bool lost = false) {
    const AnalogParameters& p = channels_[at(c)];
    if (!p.enabled) return 0.0;
    const AnalogReading reading = read(m, c, {lost ? 0.0 : p.gain, p.offset, p.noise_rms}, tick);
    if (reading.saturated) s.faults |= kSensorSaturated;
    return shown(c, reading, count);
  };
  const auto other = [&](Channel c, bool lost = false) { return counted(c, none, lost); };
  s.i_a_a = current(Channel::kCurrentA, 1.0, s.i_a_counts);
  s.i_b_a = current(Channel::kCurrentB, 2.0, s.i_b_counts);
  s.i_c_a = current(Channel::kCurrentC, 3.0, s.i_c_counts);
  s.i_f_a = current(Channel::kCurrentField, 4.0, none);
  const AnalogValues& now = m.history[slot_of(m.tick)];
  const auto voltage = [&](Channel c, std::uint64_t& count) {
    return p_.voltage.enabled ? counted(c, count) : now[at(c)];
  };
  s.u_a_v = voltage(Channel::kVoltageA, s.u_a_counts);
  s.u_b_v = voltage(Channel::kVoltageB, s.u_b_counts);
  s.u_c_v = voltage(Channel::kVoltageC, s.u_c_counts);
  s.u_f_v = voltage(Channel::kVoltageField, none);
  s.bus_voltage_v = p_.bus.enabled ? counted(Channel::kBus, s.bus_counts) : now[at(Channel::kBus)];
  s.u_n_v = other(Channel::kNeutral);
  s.temperature_k = counted(Channel::kTemperature, s.temperature_counts);
  if (p_.ntc.ohm > 0.0 && p_.counts) {
    const AnalogParameters& p = p_.temperature;
    const Errors errors{p.gain, p.offset, p.noise_rms};
    s.temperature_counts = ntc_count(p_.ntc, analog(m, Channel::kTemperature, errors, tick), p.bits);
  }
  s.tachometer_v = other(Channel::kTachometer, faults.tachometer_loss != 0.0);
  s.resolver_sin_v = other(Channel::kResolverSine, faults.resolver_loss == 1.0);
  s.resolver_cos_v = other(Channel::kResolverCosine, faults.resolver_loss == 2.0);
  const MeterFigures& figures = m.meter.figures;
  s.meter_u_rms_v = figures.voltage_v;
  s.meter_i_rms_a = figures.current_a;
  s.meter_p_w = figures.power_w;
  s.meter_q_var = figures.reactive_var;
  s.meter_pf = figures.power_factor;
  return s;
}

}  // namespace drivebench
