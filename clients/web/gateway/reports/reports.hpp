#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "clients/web/gateway/reports/bench_probe.hpp"

namespace drivebench::web {

/// What the gateway counts of itself.
struct GatewayCounts {
  std::uint64_t connections = 0;  ///< open now
  std::uint64_t browsers = 0;     ///< WebSockets that are open now
  std::uint64_t requests = 0;
  std::uint64_t bytes_to_browsers = 0;
  std::uint64_t bytes_to_bench = 0;
  std::map<std::string_view, std::uint64_t> refusals;  ///< by reason
};

/// The reading and the counts in the text format of Prometheus, version 0.0.4.
std::string metrics_text(const Reading& reading, const GatewayCounts& counts);

/// `{"status":"ok","bench":"servo",...}`; the status is "no bench" with the problem if the bench gives none.
std::string health_json(const Reading& reading);

}  // namespace drivebench::web
