#include "server/endpoints/tcp/session/refusal_log.hpp"

#include "server/host/logging/log.hpp"

namespace drivebench {

void RefusalLog::note(const Client& client, std::string_view kind, std::string_view why) {
  LogLimit& limit = limits_[{client.transport, std::string(kind)}];
  if (!limit.allow()) return;
  log::warn("{}: {}: {} ({} more since the last such line)", name_of(client), kind, why, limit.held_back());
}

}  // namespace drivebench
