#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bench.pb.h"
#include "server/access/admission.hpp"
#include "server/access/allowance.hpp"
#include "server/access/audit.hpp"
#include "server/access/places.hpp"
#include "server/endpoints/tcp/capture/capture.hpp"
#include "server/endpoints/tcp/memory/shared_bridge.hpp"
#include "server/endpoints/tcp/sending/audience.hpp"
#include "server/endpoints/tcp/sending/outbox.hpp"
#include "server/endpoints/tcp/sending/spinner.hpp"
#include "server/endpoints/tcp/session/refusal_log.hpp"
#include "server/endpoints/transport_report.hpp"
#include "server/engine/engine.hpp"
#include "server/experiments/experiments.hpp"
#include "server/host/octave_histogram.hpp"

namespace drivebench {

/// The parts that all sessions share.
struct SessionContext {
  Engine& engine;
  Admission admission;
  Audience& audience;
  Spinner& spinner;
  std::function<std::size_t()> session_count;
  std::function<std::vector<TransportReport>()> transports;  ///< reports of all transports
  Experiments* experiments;                                  ///< null: this bench has no experiments
  Audit* audit = nullptr;                                    ///< null: no audit log is kept
  Places places{{}, false};

  struct Counts {
    std::uint64_t turned_away = 0;      ///< connections, by a limit
    std::uint64_t tls_refused = 0;      ///< connections that did not get through the TLS handshake
    std::uint64_t malformed = 0;        ///< sessions that broke the protocol
    std::uint64_t wrong_tokens = 0;     ///< hellos
    std::uint64_t not_owner = 0;        ///< requests without the lease, which are no part of the run
    std::uint64_t excess_commands = 0;  ///< exchanges, in real time, that no tick can use
    std::uint64_t throttled = 0;        ///< pauses in serving a session
    std::uint64_t cut = 0;              ///< sessions whose peer read nothing, was silent or vanished
  } counts{};
  OctaveHistogram exchange_times{};  ///< from the arrival of commands to the answer with their samples
  CapturePool captures{};
  SharedBridges bridges{};
  std::shared_ptr<OutboxPool> outboxes = std::make_shared<OutboxPool>();
  v1::Envelope reply{};              ///< the message that a session is writing
  std::vector<std::byte> scratch{};  ///< its bytes
  RefusalLog log{};
  std::map<std::string, Allowance> forbidden{};  ///< by user: requests that the role does not allow
};

}  // namespace drivebench
