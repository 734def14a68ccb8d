#pragma once

#include <memory>

#include "server/endpoints/tcp/memory/shared_bridge.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"

namespace drivebench {

/// The bridge at gate level that a session has asked for.
class GateLevel {
 public:
  explicit GateLevel(Dialogue& dialogue) : dialogue_(dialogue) {}

  /// Answers with the memory, or refuses the request.
  void share(const v1::ShareBridge& request);
  /// The session has ended.
  void close();

 private:
  Dialogue& dialogue_;
  std::shared_ptr<SharedBridge> bridge_;
};

}  // namespace drivebench
