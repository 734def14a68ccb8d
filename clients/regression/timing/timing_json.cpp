#include <fmt/core.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "clients/regression/timing/log_bins.hpp"
#include "clients/regression/timing/timing_report.hpp"
#include "protocols/json.hpp"

namespace drivebench::regression {
namespace {

using TimingJson = nlohmann::ordered_json;

/// Whole nanoseconds, as microseconds.
double in_us(double ns) {
  return std::round(ns) / 1e3;
}

TimingJson histogram_json(const TimeHistogram& times) {
  TimingJson bins = TimingJson::array();
  for (const LogBin& bin : log_bins(times))
    if (bin.count != 0)
      bins.push_back(
          {in_us(static_cast<double>(bin.from_ns)), in_us(static_cast<double>(bin.to_ns)), bin.count});
  return {{"count", times.count()},
          {"p50_us", in_us(times.percentile_ns(0.5))},
          {"p99_us", in_us(times.percentile_ns(0.99))},
          {"worst_us", in_us(static_cast<double>(times.worst_ns()))},
          {"jitter_rms_us", in_us(times.jitter_rms_ns())},
          {"jitter_peak_us", in_us(times.jitter_peak_ns())},
          {"histogram", bins}};
}

void put_timing(TimingJson& object, const DeviceTiming& timing) {
  const bool is_realtime = timing.way == DeviceTiming::Way::kRealtime;
  object["answers"] = histogram_json(timing.answers.after_sample);
  object["phase"] = is_realtime ? histogram_json(timing.answers.after_tick) : TimingJson(nullptr);
  object["late"] = timing.answers.late;
  object["missed"] = timing.missed.all;
  object["longest_burst"] = timing.missed.longest_burst;
}

TimingJson effect_json(const MissedEffect& effect) {
  TimingJson signals = TimingJson::array();
  for (const SignalEffect& each : effect.signals)
    signals.push_back({{"axis", each.axis},
                       {"signal", each.signal},
                       {"unit", each.unit},
                       {"rms_difference", each.rms},
                       {"worst_difference", each.worst},
                       {"at_s", each.worst_s}});
  return {{"from_s", effect.from_s},
          {"problem", effect.problem.empty() ? TimingJson(nullptr) : TimingJson(effect.problem)},
          {"signals", signals}};
}

TimingJson group_json(const TimingGroup& group) {
  TimingJson object{{"way", word_of(group.all.way)}, {"cases", group.cases}};
  if (group.all.way == DeviceTiming::Way::kRealtime)
    object["period_us"] = in_us(static_cast<double>(group.all.period_ns));
  put_timing(object, group.all);
  return object;
}

}  // namespace

std::string timing_case_json(std::string_view name, const DeviceTiming& timing) {
  TimingJson object{{"name", name},
                    {"way", word_of(timing.way)},
                    {"period_us", in_us(static_cast<double>(timing.period_ns))}};
  put_timing(object, timing);
  object["effect"] = timing.effect ? effect_json(*timing.effect) : TimingJson(nullptr);
  return json_text(object);
}

std::string timing_json(std::string_view suite, const std::vector<TimingGroup>& groups,
                        const std::string& cases) {
  TimingJson all = TimingJson::array();
  for (const TimingGroup& group : groups)
    all.push_back(group_json(group));
  return fmt::format("{{\"suite\":{},\n\"groups\":{},\n\"cases\":[\n{}\n]}}\n", json_text(TimingJson(suite)),
                     json_text(all), cases);
}

}  // namespace drivebench::regression
