#include "clients/regression/timing/timing_report.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace drivebench::regression {
namespace {

/// So many cases have a row on the page, and the first of them a drawing, that a browser can show it.
constexpr std::size_t kMostTimingRows = 1000;
constexpr std::size_t kMostTimingDrawings = 100;

bool is_group_of(const TimingGroup& group, const DeviceTiming& timing) noexcept {
  if (group.all.way != timing.way) return false;
  return timing.way != DeviceTiming::Way::kRealtime || group.all.period_ns == timing.period_ns;
}

}  // namespace

std::string_view word_of(DeviceTiming::Way way) noexcept {
  switch (way) {
    case DeviceTiming::Way::kInProcess:
      return "in process";
    case DeviceTiming::Way::kLockstep:
      return "lockstep";
    case DeviceTiming::Way::kRealtime:
      break;
  }
  return "real time";
}

void TimingReport::add(std::string_view name, const DeviceTiming& timing) {
  auto group =
      std::ranges::find_if(groups_, [&timing](const TimingGroup& each) { return is_group_of(each, timing); });
  if (group == groups_.end()) {
    groups_.push_back({.cases = 0, .all = {.way = timing.way, .period_ns = timing.period_ns}});
    group = groups_.end() - 1;
  }
  ++group->cases;
  group->all.answers.after_sample.add(timing.answers.after_sample);
  group->all.answers.after_tick.add(timing.answers.after_tick);
  group->all.answers.late += timing.answers.late;
  group->all.missed.add(timing.missed);
  if (format_ == Format::kJson) {
    parts_ += (cases_ == 0 ? "" : ",\n") + timing_case_json(name, timing);
  } else if (cases_ < kMostTimingRows) {
    parts_ += timing_case_row(name, timing, cases_ < kMostTimingDrawings);
  }
  ++cases_;
}

std::string TimingReport::text(std::string_view suite) const {
  if (format_ == Format::kJson) return timing_json(suite, groups_, parts_);
  return timing_page(suite, groups_, parts_, cases_ - std::min(cases_, kMostTimingRows));
}

std::string TimingReport::summary() const {
  std::string text;
  for (const TimingGroup& group : groups_) {
    const TimeHistogram& times = group.all.answers.after_sample;
    text += fmt::format("answers {}: {}, p50 {:.4g} us, p99 {:.4g} us, worst {:.4g} us",
                        word_of(group.all.way), times.count(), times.percentile_ns(0.5) * 1e-3,
                        times.percentile_ns(0.99) * 1e-3, static_cast<double>(times.worst_ns()) * 1e-3);
    if (group.all.way == DeviceTiming::Way::kRealtime) {
      text += fmt::format("; {} late, {} ticks missed, at most {} in a row", group.all.answers.late,
                          group.all.missed.all, group.all.missed.longest_burst);
    }
    text += "\n";
  }
  return text;
}

}  // namespace drivebench::regression
