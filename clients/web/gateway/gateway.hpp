#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "clients/web/gateway/doors/listen_address.hpp"
#include "clients/web/gateway/runs/verb.hpp"

namespace drivebench::web {

struct GatewayOptions {
  std::string bench;        ///< its address
  std::string bench_token;  ///< of the gateway's own session; each browser shows its own
  ListenAddress listen;
  std::filesystem::path certificate;          ///< PEM; empty: no TLS
  std::filesystem::path key;                  ///< PEM
  std::string browser_token;                  ///< that browsers must show; empty: none
  std::vector<std::string> foxglove_origins;  ///< whose pages may open Foxglove's WebSocket
  std::filesystem::path page;                 ///< the folder of its files
  std::filesystem::path reports;              ///< a folder of reports; empty: none are shown
  std::filesystem::path suites;               ///< a folder of suites that browsers run; empty: none
  bool identifies = false;                    ///< for browsers, from experiments of the bench
  RunVerb verb;                               ///< for both
};

/// Serves the page, its WebSocket and the reports until SIGINT or SIGTERM. Each WebSocket is a session of its
/// own with the bench: the gateway passes frames on and adds no right to it. `ready` is called with the URL
/// once browsers can connect. Throws StartError, and link::AddressError.
void run_gateway(const GatewayOptions& options, const std::function<void(const std::string& url)>& ready);

}  // namespace drivebench::web
