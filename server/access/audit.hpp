#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "server/access/audit_budget.hpp"
#include "server/access/audit_file.hpp"
#include "server/engine/engine.hpp"
#include "server/host/clock.hpp"

namespace drivebench {

/// More about an event, by name.
using AuditDetail = std::pair<std::string_view, std::variant<std::string, double, std::uint64_t>>;

/// The audit log: the client, the action and the result, one JSON object a line. It observes the inputs on
/// their way to the engine and the samples on their way back, so it treats all transports alike. Everything
/// happens on the I/O thread.
///
/// Every action of a known subject is written; Identity slows a user down whose role forbids it. Refusals of
/// unknown clients (their requests, tokens, connections) have a budget, so that they cannot fill the disk;
/// the next line says how many were left out.
class Audit {
 public:
  /// Throws std::runtime_error if the file cannot be opened.
  explicit Audit(const AuditConfig& config);

  /// Writes the events of this bench from now on. If the configuration says so, all controllers lose their
  /// axes when a line cannot be written.
  void watch(Engine& engine);

  struct Event {
    std::string_view name;
    std::optional<std::uint32_t> axis{};
    const Client* client = nullptr;
    std::string_view result = "done";  ///< anything else is the reason of a refusal
    std::vector<AuditDetail> details{};
    bool is_repeatable = false;  ///< the client can do it as often as it likes: has the budget of a refusal
  };
  void note(Event event);

  /// Goes on in a new file of the same name, after a rotation.
  bool reopen() noexcept { return file_.reopen(); }
  /// Lines that could not be written.
  std::uint64_t lost() const noexcept { return lost_; }

 private:
  void on_answer(const Input& input, const Client* from, Refused refused, Tick tick);
  void on_taken(const Taken& taken);
  void on_tick();
  void watch_axis(std::uint32_t axis);
  bool may_write(const Event& event);
  void fail();

  struct Seen {
    Owner holder = 0;  ///< of the axis, by the answered requests
    std::uint64_t state = 0;
    std::uint64_t faults = 0;
  };

  AuditFile file_;
  AuditFailure on_failure_;
  Engine* engine_ = nullptr;
  std::vector<Seen> seen_;  // by axis
  std::uint64_t seen_gaps_ = 0;
  AuditBudget budget_;
  std::uint64_t left_out_ = 0;
  std::uint64_t lost_ = 0;
  bool failing_ = false;
};

}  // namespace drivebench
