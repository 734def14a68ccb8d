#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "server/endpoints/log_limit.hpp"
#include "server/engine/owners.hpp"

namespace drivebench {

/// Tells the log of refused clients: for each transport and kind of refusal at most one line in ten seconds,
/// so that a flood of one kind does not hide another.
class RefusalLog {
 public:
  /// `kind` is one of few, `why` one sentence.
  void note(const Client& client, std::string_view kind, std::string_view why);

 private:
  std::map<std::pair<std::string, std::string>, LogLimit> limits_;  // by transport and kind
};

}  // namespace drivebench
