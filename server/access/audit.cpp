#include "server/access/audit.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "plant/parameters/parameters.hpp"
#include "protocols/json.hpp"
#include "server/access/address.hpp"
#include "server/host/logging/log.hpp"
#include "server/host/wall_time.hpp"

namespace drivebench {
namespace {

/// Name and details of an input in the log; an input without a name is not written.
class Description {
 public:
  Description(const Engine& engine, const Input& input) : engine_(engine), input_(input) {
    std::visit([this](const auto& action) { describe(action); }, input.action);
    if (!name.empty() && input.tick > 0)
      details.emplace_back("at_tick", static_cast<std::uint64_t>(input.tick));
  }

  std::string_view name;
  std::vector<AuditDetail> details;

 private:
  void describe(const LeaseAction& action) {
    // A renewal changes nothing.
    constexpr std::array<std::string_view, 5> kNames{"", "acquire", "", "release", "lease_lost"};
    const auto index = static_cast<std::size_t>(action);
    if (index < kNames.size()) name = kNames[index];
    if (input_.owner != 0) details.emplace_back("owner", input_.owner);
  }
  void describe(const LoadChange& load) {
    name = "load";
    details.emplace_back("load_nm", load.load_nm);
    details.emplace_back("ramp_ticks", static_cast<std::uint64_t>(load.ramp_ticks));
  }
  void describe(const ParameterWrite& write) {
    name = "parameter";
    const std::span<const Parameter> rows = axis_parameters(engine_.parameters(input_.axis));
    details.emplace_back("name", write.row < rows.size() ? std::string(rows[write.row].name) : "");
    details.emplace_back("value", write.value);
    details.emplace_back("ramp_ticks", static_cast<std::uint64_t>(write.ramp_ticks));
  }
  void describe(const InjectFault& fault) {
    name = "inject";
    details.emplace_back(
        "name", fault.row < kInjectableFaultCount ? std::string(kInjectableFaults[fault.row].name) : "");
    details.emplace_back("value", fault.value);
  }
  void describe(const ShaftBump& bump) {
    name = "bump";
    details.emplace_back("impulse_nms", bump.impulse_nms);
  }
  void describe(const ClearFaults&) { name = "clear"; }
  template <class Other>
  void describe(const Other&) {}

  const Engine& engine_;
  const Input& input_;
};

bool is_driven(std::uint64_t state) noexcept {
  return drivebench::is_driven(static_cast<ControlState>(state));
}

}  // namespace

Audit::Audit(const AuditConfig& config) : file_(config.file), on_failure_(config.on_failure) {}

void Audit::watch(Engine& engine) {
  engine_ = &engine;
  seen_.resize(engine.config().axes.size());
  engine.on_answered = [this](const Input& input, const Client* from, Refused refused, Tick tick) {
    on_answer(input, from, refused, tick);
  };
  engine.on_taken.push_back([this](const Taken& taken) { on_taken(taken); });
  engine.on_tick.add([this] { on_tick(); });
}

void Audit::on_answer(const Input& input, const Client* from, Refused refused, Tick tick) {
  Description described(*engine_, input);
  if (described.name.empty() || input.axis >= seen_.size()) return;
  if (refused == Refused::kNot) {
    Owner& holder = seen_[input.axis].holder;
    if (described.name == "acquire") holder = input.owner;
    if (described.name == "release" || described.name == "lease_lost") holder = 0;
  }
  described.details.emplace_back("answered_tick", static_cast<std::uint64_t>(tick));
  note({.name = described.name,
        .axis = input.axis,
        .client = from,
        .result = refused == Refused::kNot ? "done" : sentence_of(refused),
        .details = std::move(described.details)});
}

void Audit::on_taken(const Taken& taken) {
  const Client* const before = engine_->client(taken.from);
  note({.name = "take",
        .axis = taken.axis,
        .client = engine_->client(taken.by),
        .details = {{"reason", taken.reason},
                    {"from", before == nullptr ? std::string() : name_of(*before)},
                    {"from_owner", taken.from},
                    {"owner", taken.by}}});
}

void Audit::on_tick() {
  for (std::uint32_t axis = 0; axis < seen_.size(); ++axis)
    watch_axis(axis);
  const Recorder* const recorder = engine_->recorder();
  if (recorder == nullptr || recorder->gaps() == seen_gaps_) return;
  if (!budget_.take("recording_lost", {}, ServerClock::now())) return;
  seen_gaps_ = recorder->gaps();
  note({.name = "recording_lost",
        .details = {{"file", recorder->file()}, {"gaps", seen_gaps_}, {"remarks", recorder->remarks()}}});
}

void Audit::watch_axis(std::uint32_t axis) {
  const Sample& now = engine_->newest(axis);
  Seen& seen = seen_[axis];
  if (now.state == seen.state && now.faults == seen.faults && now.owner == seen.holder) return;
  const Client* const owner = engine_->client(now.owner != 0 ? now.owner : seen.holder);
  if (is_driven(now.state) && !is_driven(seen.state)) {
    note({.name = "armed", .axis = axis, .client = owner, .details = {{"state", "run"}}});
  }
  const std::uint64_t latched = now.faults & ~seen.faults & kLatchedFaults;
  if (latched != 0) {
    note({.name = "latched",
          .axis = axis,
          .client = owner,
          .details = {{"faults", fmt::format("{:#x}", latched)}}});
  }
  if (seen.holder != 0 && engine_->owner(axis) != seen.holder) {
    note({.name = "lease_expired",
          .axis = axis,
          .client = engine_->client(seen.holder),
          .details = {{"owner", std::exchange(seen.holder, Owner{0})}}});
  }
  seen.state = now.state;
  seen.faults = now.faults;
}

bool Audit::may_write(const Event& event) {
  const Client* const client = event.client;
  if (client != nullptr && !client->subject.empty()) return true;
  const std::string address = client == nullptr ? std::string() : address_of(*client);
  return budget_.take(event.name, address, ServerClock::now());
}

void Audit::note(Event event) {
  if ((event.result != "done" || event.is_repeatable) && !may_write(event)) {
    ++left_out_;
    return;
  }
  nlohmann::ordered_json line;
  line["time"] = rfc3339(std::chrono::system_clock::now());
  line["monotonic_ns"] = ServerClock::now().time_since_epoch().count();
  line["tick"] = engine_ != nullptr ? engine_->tick() : 0;
  line["event"] = event.name;
  line["axis"] = event.axis ? nlohmann::ordered_json(engine_->config().axes[*event.axis].name) : nullptr;
  const Client unknown;
  const Client& client = event.client != nullptr ? *event.client : unknown;
  line["transport"] = client.transport;
  line["peer"] = client.peer;
  line["subject"] = client.subject;
  line["result"] = event.result;
  line["details"] = nlohmann::ordered_json::object();
  for (const AuditDetail& detail : event.details) {
    const std::string name(detail.first);
    std::visit([&](const auto& value) { line["details"][name] = value; }, detail.second);
  }
  if (left_out_ > 0) line["details"]["left_out_before"] = left_out_;
  if (lost_ > 0) line["details"]["lost_before"] = lost_;
  // All but ASCII is escaped, so that the name of a client can neither break a line nor control a terminal.
  if (file_.append(ascii_json_text(line))) {
    left_out_ = 0;
    if (std::exchange(failing_, false)) log::warn("the audit log can be written again");
  } else {
    fail();
  }
}

void Audit::fail() {
  ++lost_;
  const bool is_news = !std::exchange(failing_, true);
  if (is_news) log::error("the audit log cannot be written: {}", std::generic_category().message(errno));
  if (on_failure_ != AuditFailure::kSafe || engine_ == nullptr) return;
  // The log fails for these losses too and calls fail() again, but by then the leases are gone from seen_.
  for (std::uint32_t axis = 0; axis < seen_.size(); ++axis) {
    const Owner owner = std::exchange(seen_[axis].holder, Owner{0});
    if (owner == 0) continue;
    engine_->request({.tick = 0, .axis = axis, .owner = owner, .action = LeaseAction::kLost},
                     [](Refused, Tick) {});
  }
}

}  // namespace drivebench
