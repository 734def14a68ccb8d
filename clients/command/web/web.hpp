#pragma once

#include <string>
#include <vector>

#include "clients/command/common/session/link_choice.hpp"

namespace drivebench::command {

struct WebOptions {
  LinkChoice link{};
  bool json = false;
  std::string listen = "127.0.0.1:7380";
  std::string certificate{};           ///< a file, PEM
  std::string key{};                   ///< a file, PEM
  std::string browser_token{};         ///< a file with the token that browsers must show
  std::string reports{};               ///< a folder of reports for the page
  std::string suites{};                ///< a folder of suites that the page runs
  bool identifies = false;             ///< for the page
  std::vector<std::string> origins{};  ///< whose pages may open Foxglove's WebSocket
};
int run_web(const WebOptions& options);

}  // namespace drivebench::command
