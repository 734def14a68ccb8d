#include "clients/command/common/programs/server_ready.hpp"

#include "clients/command/common/basics/json.hpp"

namespace drivebench::command {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ServerReady, tcp, can, modbus, mode, bench)

std::optional<ServerReady> parse_ready(std::string_view line) {
  return parsed<ServerReady>(line, "ready");
}

}  // namespace drivebench::command
