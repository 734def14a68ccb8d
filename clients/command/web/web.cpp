#include "clients/command/web/web.hpp"

#include <fmt/core.h>

#include <cstdio>
#include <fstream>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/web/child_verb.hpp"
#include "clients/web/gateway/gateway.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {
namespace {

/// The first line of a file.
std::string token_in(const std::string& path) {
  std::ifstream file(path);
  std::string token;
  if (!std::getline(file, token)) throw UsageError("--browser-token " + path + ": no token to read");
  return token;
}

}  // namespace

int run_web(const WebOptions& options) {
  web::GatewayOptions gateway;
  gateway.bench = options.link.address;
  gateway.bench_token = options.link.token;
  gateway.certificate = options.certificate;
  gateway.key = options.key;
  if (!options.browser_token.empty()) gateway.browser_token = token_in(options.browser_token);
  gateway.foxglove_origins = options.origins;
  gateway.page = find_page();
  gateway.reports = options.reports;
  gateway.suites = options.suites;
  gateway.identifies = options.identifies;
  gateway.verb = run_child_verb;
  try {
    gateway.listen = web::parse_listen_address(options.listen);
    web::run_gateway(gateway, [&options](const std::string& url) {
      fmt::print("{}\n", options.json ? json_text(Json{{"event", "ready"}, {"url", url}})
                                      : "the bench in a browser: " + url);
      std::fflush(stdout);
    });
  } catch (const web::StartError& error) {
    throw UsageError(error.what());
  }
  return kExitOk;
}

}  // namespace drivebench::command
