#include "clients/web/gateway/reports/bench_probe.hpp"

#include <exception>

namespace drivebench::web {

using namespace std::chrono_literals;

const Reading& BenchProbe::read() {
  if (Clock::now() >= until_) {
    reading_ = ask();
    until_ = Clock::now() + 250ms;
  }
  return reading_;
}

Reading BenchProbe::ask() {
  // A link that the bench has closed since the last reading fails once; then a new one is tried.
  for (const bool is_last_try : {link_ == nullptr, true}) {
    try {
      if (!link_) {
        link_ = std::make_unique<link::Link>(
            address_, link::LinkOptions{.client = "drivebench web", .token = token_, .deadline = 2000ms});
      }
      const v1::Status& status = link_->status();
      return {.bench = link_->welcome().bench(), .build_id = link_->welcome().build_id(), .status = status};
    } catch (const std::exception& error) {
      link_.reset();
      if (is_last_try) return {.problem = error.what()};
    }
  }
  return {};
}

}  // namespace drivebench::web
