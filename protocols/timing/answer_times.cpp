#include "protocols/timing/answer_times.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace drivebench {
namespace {

/// A bin is told by its lower edge, the first one by the smallest duration.
nlohmann::json histogram_json(const TimeHistogram& histogram) {
  nlohmann::json bins = nlohmann::json::array();
  histogram.each_bin([&](std::int64_t lower_ns, std::int64_t, std::uint64_t times) {
    bins.push_back({std::max(lower_ns, histogram.smallest_ns()), times});
  });
  return {{"worst_ns", histogram.worst_ns()}, {"bins", bins}};
}

TimeHistogram histogram_of(const nlohmann::json& object) {
  TimeHistogram histogram;
  const nlohmann::json& bins = object.at("bins");
  for (const nlohmann::json& bin : bins) {
    const auto times = bin.at(1).get<std::uint64_t>();
    const bool has_worst = &bin == &bins.back() && times > 0;
    histogram.add(bin.at(0).get<std::int64_t>(), has_worst ? times - 1 : times);
    if (has_worst) histogram.add(object.at("worst_ns").get<std::int64_t>());
  }
  return histogram;
}

}  // namespace

nlohmann::json answer_times_json(const AnswerTimes& times) {
  return {{"after_sample", histogram_json(times.after_sample)},
          {"after_tick", histogram_json(times.after_tick)},
          {"late", times.late}};
}

AnswerTimes answer_times_of(const nlohmann::json& object) {
  return {.after_sample = histogram_of(object.at("after_sample")),
          .after_tick = histogram_of(object.at("after_tick")),
          .late = object.at("late").get<std::uint64_t>()};
}

}  // namespace drivebench
