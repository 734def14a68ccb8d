#include "clients/web/gateway/drive/drive.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "protocols/framing.hpp"
#include "protocols/json.hpp"

namespace drivebench::web {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

constexpr auto kAnswerTime = 500ms;  // for the answer to the last command, before the leases go back
constexpr auto kReportPeriod = 200ms;
constexpr auto kLargestLag = 50ms;  // lockstep: what a late gateway catches up
constexpr std::byte kIdTag{0x08};   // field 1 of Envelope, which comes first

/// The id of an envelope, from its first bytes: only the answers of the drive are worth a whole look.
std::uint64_t id_of(std::span<const std::byte> payload) noexcept {
  if (payload.empty() || payload[0] != kIdTag) return 0;
  std::uint64_t id = 0;
  for (std::size_t i = 1; i < payload.size() && i <= 10; ++i) {
    const auto byte = std::to_integer<std::uint64_t>(payload[i]);
    id |= (byte & 0x7f) << 7 * (i - 1);
    if (byte < 0x80) break;
  }
  return id;
}

Drive::Time::duration seconds(double value) noexcept {
  return std::chrono::duration_cast<Drive::Time::duration>(std::chrono::duration<double>(value));
}

Json run_json(const ReferenceRun& run) {
  Json numbers = Json::array();
  for (const reference::ReportRow& each : run.rows())
    numbers.push_back({{"name", each.name}, {"value", each.value}, {"unit", each.unit}});
  return {{"number", run.number()},     {"preset", run.preset()},   {"phase", run.phase()},
          {"progress", run.progress()}, {"failure", run.failure()}, {"numbers", std::move(numbers)}};
}

/// For each axis the presets that fit it.
Json presets_json(const v1::BenchDescription& bench) {
  Json axes = Json::array();
  for (int axis = 0; axis < bench.axes_size(); ++axis) {
    Json presets = Json::array();
    for (const control::Preset* const each : offered_presets(bench, static_cast<std::uint32_t>(axis)))
      presets.push_back({{"name", each->name}, {"source", each->source}, {"expectation", each->expectation}});
    axes.push_back(std::move(presets));
  }
  return axes;
}

}  // namespace

Drive::Drive(const v1::Welcome& welcome)
    : period_s_(welcome.bench().period_s()),
      is_lockstep_(welcome.bench().mode() == v1::MODE_LOCKSTEP),
      bench_(std::make_shared<v1::BenchDescription>(welcome.bench())),
      runs_(static_cast<std::size_t>(welcome.bench().axes_size())) {
  axes_.reserve(static_cast<std::size_t>(welcome.bench().axes_size()));
  for (const v1::AxisDescription& axis : welcome.bench().axes()) {
    axes_.emplace_back(static_cast<std::uint32_t>(axes_.size()), period_s_,
                       OpenLoopTerminals{.phases = axis.phases(),
                                         .two_phase = axis.connection() == "two_phase",
                                         .star = axis.connection() == "star"});
  }
}

Order Drive::read(std::string_view text) const {
  return parse_order(text, axes_.size());
}

std::vector<Beginning> Drive::beginnings_of(const Order& order) const {
  std::vector<Beginning> beginnings;
  for (const Order::Axis& each : order.axes) {
    const bool goes_on = runs_[each.axis] && runs_[each.axis]->number() == each.run;
    if (!each.preset.empty() && !goes_on)
      beginnings.push_back({.axis = each.axis, .preset = each.preset, .number = each.run});
  }
  return beginnings;
}

void Drive::carry_out(const Order& order, Runs begun, Time now) {
  heard_ = now;
  if (order.kind == Order::Kind::kPresets) has_news_ = is_asked_for_presets_ = true;
  if (stage_ != Stage::kOver && stage_ != Stage::kDriving) return;  // what ends is not taken up again
  if (order.kind == Order::Kind::kDrive) {
    set_targets(order, std::move(begun), now);
  } else if (order.kind == Order::Kind::kPace) {
    pace_ = order.pace;
    steps_ = 0;
    due_ = now;
  } else if (order.kind == Order::Kind::kStep && pace_ == 0.0) {
    steps_ += order.ticks;
  }
}

void Drive::set_targets(const Order& order, Runs begun, Time now) {
  tell({});
  if (order.axes.empty()) return switch_off_and_release(now);
  if (is_over()) {
    knows_tick_ = false;
    due_ = now;
  }
  driven_.clear();
  for (const Order::Axis& each : order.axes) {
    driven_.push_back(each.axis);
    if (!each.preset.empty()) continue;
    axes_[each.axis].follow(each.target);
    runs_[each.axis].reset();
  }
  for (std::unique_ptr<ReferenceRun>& each : begun) {
    axes_[each->axis()].switch_off();
    runs_[each->axis()] = std::move(each);
  }
  for (OpenLoop& each : axes_) {
    if (std::ranges::find(driven_, each.axis()) != driven_.end()) continue;
    each.switch_off();
    runs_[each.axis()].reset();
  }
  stage_ = Stage::kDriving;
  gave_back_ = false;
}

void Drive::switch_off_and_release(Time now) {
  if (is_over()) return;
  stage_ = Stage::kSwitchingOff;
  deadline_ = now + kAnswerTime;
  is_off_sent_ = false;
  switch_off("stopped");
}

void Drive::tell(std::string problem) {
  problem_ = std::move(problem);
  has_news_ = true;
}

void Drive::leave(Time now) {
  if (stage_ != Stage::kDriving) return;
  has_news_ = true;
  stage_ = Stage::kRampingDown;
  deadline_ = now + kRampDown + kAnswerTime;
  const double pace = is_lockstep_ ? pace_ : 1.0;
  const double longest_s = pace * std::chrono::duration<double>(kRampDown).count();
  for (const std::uint32_t axis : driven_) {
    if (runs_[axis]) runs_[axis]->wind_down(longest_s);
    axes_[axis].ramp_down(longest_s);
  }
}

/// The stages that end the drive, one after the other.
void Drive::move_on(Time now) {
  if (stage_ == Stage::kDriving && now >= heard_ + kSilence) {
    leave(now);
    tell("the page was silent: the drive ramps down and gives the leases back");
  }
  if (stage_ == Stage::kRampingDown && (has_arrived() || now >= deadline_)) switch_off_and_release(now);
  if (stage_ == Stage::kSwitchingOff && now >= deadline_) stage_ = Stage::kReleasing;
}

Drive::Turn Drive::next(Time now) {
  move_on(now);
  if (stage_ == Stage::kOver) return {};
  if (stage_ == Stage::kReleasing) return {.bytes = releases(), .again = now};
  const Time watched = stage_ == Stage::kDriving ? heard_ + kSilence : deadline_;
  if (is_waiting_) return {.bytes = {}, .again = watched};
  const Time runs = due(now);
  if (runs > now) return {.bytes = {}, .again = std::min(runs, watched)};
  return {.bytes = exchange(now), .again = now};
}

Drive::Time Drive::due(Time now) const noexcept {
  if (!is_lockstep_ || !knows_tick_ || stage_ == Stage::kSwitchingOff || steps_ > 0) return now;
  return pace_ > 0.0 ? due_ : Time::max();
}

bool Drive::take(std::span<const std::byte> payload, Time now) {
  if (id_of(payload) < kFirstId) return false;
  v1::Envelope answer;
  if (!answer.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) return false;
  if (answer.id() != last_id_ || !is_waiting_) return true;  // of a lease that went back
  is_waiting_ = false;
  if (is_over()) return true;
  if (answer.has_exchange_reply()) taken(answer.exchange_reply());
  if (answer.has_refusal()) refused(answer.refusal());
  if (now - reported_ >= kReportPeriod) has_news_ = true;
  return true;
}

void Drive::taken(const v1::ExchangeReply& reply) {
  if (reply.samples().empty()) return;
  for (const v1::AxisSample& each : reply.samples()) {
    if (each.axis() >= runs_.size() || !runs_[each.axis()]) continue;
    const bool was_over = runs_[each.axis()]->is_over();
    runs_[each.axis()]->take(each.sample());
    has_news_ = has_news_ || was_over != runs_[each.axis()]->is_over();
  }
  tick_ = reply.samples(0).sample().tick();
  knows_tick_ = true;
  if (stage_ == Stage::kSwitchingOff && is_off_sent_) stage_ = Stage::kReleasing;
}

void Drive::refused(const v1::Refusal& refusal) {
  tell(refusal.message());
  knows_tick_ = false;
  const bool is_hopeless = is_off() || refusal.code() == v1::REFUSAL_NOT_OWNER;
  switch_off("the bench refused: " + refusal.message());
  if (is_hopeless) stage_ = Stage::kReleasing;
}

void Drive::switch_off(const std::string& why) {
  for (const std::uint32_t axis : driven_) {
    axes_[axis].switch_off();
    if (runs_[axis]) runs_[axis]->switch_off(why);
  }
}

bool Drive::is_off() const noexcept {
  return std::ranges::all_of(driven_, [this](std::uint32_t axis) {
    return runs_[axis] ? runs_[axis]->is_over() : axes_[axis].gates() == v1::GATES_OFF;
  });
}

bool Drive::has_arrived() const noexcept {
  return std::ranges::all_of(driven_, [this](std::uint32_t axis) {
    if (runs_[axis]) return runs_[axis]->is_over();
    return axes_[axis].gates() == v1::GATES_OFF || axes_[axis].has_arrived();
  });
}

v1::Command Drive::command(std::uint32_t axis) {
  return runs_[axis] ? runs_[axis]->command(tick_) : axes_[axis].command(tick_);
}

std::string Drive::exchange(Time now) {
  v1::Envelope request;
  v1::Exchange& exchange = *request.mutable_exchange();
  if (knows_tick_) {
    for (const std::uint32_t axis : driven_)
      *exchange.add_commands() = command(axis);
    is_off_sent_ = stage_ == Stage::kSwitchingOff;
    if (steps_ > 0) --steps_;
    if (pace_ > 0.0) due_ = std::max(due_ + seconds(period_s_ / pace_), now - kLargestLag);
  }
  is_waiting_ = true;
  std::string bytes;
  add_frame(bytes, request);
  return bytes;
}

std::string Drive::releases() {
  std::string bytes;
  for (const std::uint32_t axis : driven_) {
    v1::Envelope request;
    request.mutable_lease()->set_axis(axis);
    request.mutable_lease()->set_action(v1::LeaseRequest::ACTION_RELEASE);
    add_frame(bytes, request);
  }
  driven_.clear();
  is_waiting_ = false;
  stage_ = Stage::kOver;
  gave_back_ = true;
  has_news_ = true;
  return bytes;
}

void Drive::add_frame(std::string& bytes, v1::Envelope& envelope) {
  envelope.set_id(++last_id_);
  const std::string payload = envelope.SerializeAsString();
  const auto header = frame_header(static_cast<std::uint32_t>(payload.size()));
  bytes.append(reinterpret_cast<const char*>(header.data()), header.size());
  bytes += payload;
}

const char* Drive::state_word() const noexcept {
  if (stage_ == Stage::kDriving) return "drives";
  if (stage_ != Stage::kOver) return "ends";
  return gave_back_ ? "over" : "idle";
}

std::string Drive::report(Time now) {
  if (!std::exchange(has_news_, false)) return {};
  reported_ = now;
  Json axes = Json::array();
  for (const std::uint32_t axis : driven_) {
    const OpenLoop& each = axes_[axis];
    axes.push_back({{"axis", axis},
                    {"gates", word_of(each.gates())},
                    {"frequency_hz", each.frequency_hz()},
                    {"amplitude", each.amplitude()}});
    if (runs_[axis]) axes.back()["run"] = run_json(*runs_[axis]);
  }
  Json report = {{"state", state_word()}, {"problem", problem_}, {"axes", std::move(axes)}};
  if (std::exchange(is_asked_for_presets_, false)) report["presets"] = presets_json(*bench_);
  return json_text(report);
}

}  // namespace drivebench::web
