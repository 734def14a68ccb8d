#include "server/endpoints/tcp/session/shared_memory/gate_level.hpp"

#include <chrono>
#include <exception>
#include <string>

#include "server/endpoints/tcp/session/shared_memory/sharing.hpp"

namespace drivebench {

void GateLevel::share(const v1::ShareBridge& r) {
  const auto refuse = [this](v1::RefusalCode code, const std::string& sentence, const char* field) {
    dialogue_.refuse(dialogue_.id(), code, sentence, field);
  };
  if (!may_share(dialogue_, r.spin_us(), bridge_ != nullptr)) return;
  const BenchConfig& config = dialogue_.engine().config();
  if (config.mode == RunMode::kRealtime) {
    return refuse(
        v1::REFUSAL_WRONG_MODE,
        "a bench in real time has no gate level: its ticks need the CPUs; use lockstep, or inproc:", "kind");
  }
  if (const InprocBridge::Problem problem = InprocBridge::problem_with(config, r.axis());
      problem.code != DRIVEBENCH_OK) {
    return refuse(static_cast<v1::RefusalCode>(problem.code), problem.sentence, "axis");
  }
  try {
    const auto bridge =
        dialogue_.context().bridges.open(config, r.axis(), std::chrono::microseconds(r.spin_us()));
    if (bridge == nullptr) {
      return refuse(v1::REFUSAL_BUSY,
                    "the bench has " + std::to_string(SharedBridges::kMost) +
                        " bridges at gate level already: wait until one is closed",
                    "kind");
    }
    bridge_ = bridge;
    answer_with_memory(dialogue_, bridge->memory().bytes(), [&](std::span<const std::byte> bytes) {
      return bridge->memory().send_with(dialogue_.socket().native_handle(), bytes);
    });
  } catch (const std::exception& error) {
    close();
    refuse(v1::REFUSAL_BUSY, error.what(), "kind");
  }
}

void GateLevel::close() {
  if (bridge_ != nullptr) bridge_->end();
  bridge_.reset();
}

}  // namespace drivebench
