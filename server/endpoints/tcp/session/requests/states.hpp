#pragma once

#include <cstddef>
#include <vector>

#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/endpoints/tcp/session/requests/leases.hpp"

namespace drivebench {

/// What a session does with whole states of the bench.
class States {
 public:
  States(Dialogue& dialogue, Leases& leases) : dialogue_(dialogue), leases_(leases) {}

  void save();
  void restore(const v1::RestoreState& request);
  void reset();

 private:
  bool may_set_back();
  /// Answers a request that has brought the bench away from the tick `before`, and notes it in the audit log.
  void done(const char* event, Tick before);

  Dialogue& dialogue_;
  Leases& leases_;
  std::vector<std::byte> parts_;  ///< of a state that is still to come whole
};

}  // namespace drivebench
