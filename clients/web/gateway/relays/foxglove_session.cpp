#include "clients/web/gateway/relays/foxglove_session.hpp"

#include <fmt/core.h>
#include <openssl/evp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "protocols/descriptor_set.hpp"
#include "protocols/json.hpp"

namespace drivebench::web {
namespace {

constexpr int kInfo = 0;
constexpr int kWarning = 1;
constexpr int kError = 2;
constexpr char kMessageData = 1;
constexpr char kTime = 2;
constexpr std::size_t kShown = 40;  // characters of a wrong value

/// The message of a client breaks a rule.
struct Refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

std::string base64(const std::string& bytes) {
  std::string text((bytes.size() + 2) / 3 * 4 + 1, '\0');
  EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                  reinterpret_cast<const unsigned char*>(bytes.data()), static_cast<int>(bytes.size()));
  text.pop_back();
  return text;
}

template <class Number>
void put_little_endian(std::string& bytes, Number value) {
  for (std::size_t i = 0; i < sizeof(Number); ++i)
    bytes.push_back(static_cast<char>(value >> 8 * i & 0xff));
}

nlohmann::json parsed(std::string_view text) {
  try {
    return parse_json(text);
  } catch (const nlohmann::json::parse_error&) {
    throw Refused("the message is not JSON");
  }
}

std::string shown(const nlohmann::json& value) {
  const std::string text = ascii_json_text(value);
  return text.size() <= kShown ? text : text.substr(0, kShown) + "...";
}

const nlohmann::json& field_of(const nlohmann::json& object, const char* name, const std::string& place) {
  const auto field = object.is_object() ? object.find(name) : object.end();
  if (field == object.end()) throw Refused(fmt::format("{}{}: is missing", place, name));
  return *field;
}

const nlohmann::json& list_in(const nlohmann::json& object, const char* name) {
  const nlohmann::json& list = field_of(object, name, "");
  if (!list.is_array()) throw Refused(fmt::format("{}: {} is no list", name, shown(list)));
  return list;
}

std::uint32_t number_of(const nlohmann::json& value, const std::string& field) {
  constexpr std::uint32_t kMax = std::numeric_limits<std::uint32_t>::max();
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > kMax)
    throw Refused(fmt::format("{}: {} is no whole number from 0 to {}", field, shown(value), kMax));
  return value.get<std::uint32_t>();
}

void subscribe(std::vector<FoxgloveChannel>& channels, const nlohmann::json& wish, const std::string& place) {
  const std::uint32_t id = number_of(field_of(wish, "id", place), place + "id");
  const std::uint32_t number = number_of(field_of(wish, "channelId", place), place + "channelId");
  if (number == 0 || number > channels.size())
    throw Refused(
        fmt::format("{}channelId: {} is not one of the channels 1 to {}", place, number, channels.size()));
  for (const FoxgloveChannel& each : channels) {
    if (each.is_subscribed && each.subscription == id)
      throw Refused(fmt::format("{}id: {} is the subscription of {} already", place, id, each.topic));
  }
  FoxgloveChannel& channel = channels[number - 1];
  if (channel.is_subscribed)
    throw Refused(
        fmt::format("{}channelId: {} has the subscription {} already, and a channel has one at a time", place,
                    number, channel.subscription));
  channel.is_subscribed = true;
  channel.subscription = id;
  channel.lost = 0;
}

void unsubscribe(std::vector<FoxgloveChannel>& channels, std::uint32_t id, const std::string& field) {
  const auto channel = std::ranges::find_if(
      channels, [id](const FoxgloveChannel& each) { return each.is_subscribed && each.subscription == id; });
  if (channel == channels.end()) throw Refused(fmt::format("{}: {} is no subscription", field, id));
  channel->is_subscribed = false;
}

/// What the bench has to change. A channel whose subscription only has another number needs nothing.
std::vector<v1::Subscribe> changes_between(const std::vector<FoxgloveChannel>& before,
                                           const std::vector<FoxgloveChannel>& after) {
  std::vector<v1::Subscribe> changes;
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (before[i].is_subscribed == after[i].is_subscribed) continue;
    v1::Subscribe change;
    change.set_axis(static_cast<std::uint32_t>(i));
    change.set_decimation(after[i].is_subscribed ? 1 : 0);
    changes.push_back(std::move(change));
  }
  return changes;
}

std::string server_info(const v1::Welcome& welcome) {
  const v1::BenchDescription& bench = welcome.bench();
  nlohmann::ordered_json metadata{{"build", welcome.build_id()},
                                  {"mode", v1::Mode_Name(bench.mode())},
                                  {"period_s", fmt::format("{}", bench.period_s())}};
  for (const v1::SignalDescription& signal : bench.signals())
    metadata["unit." + signal.name()] = signal.unit();
  for (const v1::AxisDescription& axis : bench.axes())
    metadata["machine." + axis.name()] = axis.machine();
  return json_text(nlohmann::ordered_json{{"op", "serverInfo"},
                                          {"name", "drivebench: " + bench.name()},
                                          {"capabilities", {"time"}},
                                          {"metadata", std::move(metadata)}});
}

}  // namespace

std::string_view foxglove_subprotocol(std::string_view offered) noexcept {
  while (!offered.empty()) {
    const std::size_t comma = std::min(offered.find(','), offered.size());
    std::string_view name = offered.substr(0, comma);
    name.remove_prefix(std::min(name.find_first_not_of(" \t"), name.size()));
    name = name.substr(0, name.find_last_not_of(" \t") + 1);
    const auto* const known = std::ranges::find(kFoxgloveSubprotocols, name);
    if (known != std::end(kFoxgloveSubprotocols)) return *known;
    offered.remove_prefix(std::min(comma + 1, offered.size()));
  }
  return {};
}

FoxgloveSession::FoxgloveSession(const v1::Welcome& welcome) : period_ns_(welcome.bench().period_s() * 1e9) {
  put(true, server_info(welcome));
  const std::string schema = base64(bench_descriptor_set());
  nlohmann::ordered_json channels = nlohmann::ordered_json::array();
  for (const v1::AxisDescription& axis : welcome.bench().axes()) {
    channels_.push_back({.topic = "/" + axis.name() + "/sample"});
    channels.push_back({{"id", channels_.size()},
                        {"topic", channels_.back().topic},
                        {"encoding", "protobuf"},
                        {"schemaName", std::string(v1::Sample::descriptor()->full_name())},
                        {"schemaEncoding", "protobuf"},
                        {"schema", schema}});
  }
  put(true, json_text(nlohmann::ordered_json{{"op", "advertise"}, {"channels", std::move(channels)}}));
  if (welcome.bench().mode() == v1::MODE_LOCKSTEP)
    tell(kInfo, "The bench runs in lockstep: time stands still until a controller drives it.", "lockstep");
}

std::vector<v1::Subscribe> FoxgloveSession::text(std::string_view text) {
  try {
    const nlohmann::json message = parsed(text);
    const nlohmann::json& op = field_of(message, "op", "");
    std::vector<FoxgloveChannel> channels = channels_;
    if (op == "subscribe") {
      const nlohmann::json& list = list_in(message, "subscriptions");
      for (std::size_t i = 0; i < list.size(); ++i)
        subscribe(channels, list[i], fmt::format("subscriptions[{}].", i));
    } else if (op == "unsubscribe") {
      const nlohmann::json& list = list_in(message, "subscriptionIds");
      for (std::size_t i = 0; i < list.size(); ++i) {
        const std::string field = fmt::format("subscriptionIds[{}]", i);
        unsubscribe(channels, number_of(list[i], field), field);
      }
    } else {
      throw Refused(fmt::format("op: {} is not one of subscribe, unsubscribe", shown(op)));
    }
    // While the client has no subscription, the session does not see that the bench is set back.
    if (std::ranges::none_of(channels_, &FoxgloveChannel::is_subscribed)) time_ns_ = 0;
    std::vector<v1::Subscribe> changes = changes_between(channels_, channels);
    channels_ = std::move(channels);
    return changes;
  } catch (const Refused& refused) {
    tell(kError, refused.what());
  }
  return {};
}

void FoxgloveSession::binary(std::string_view bytes) {
  const std::string opcode = bytes.empty() ? "none" : std::to_string(static_cast<unsigned char>(bytes[0]));
  tell(kError, "opcode: " + opcode + ", but this server takes no binary message: its clients only subscribe");
}

void FoxgloveSession::from_bench(const v1::Envelope& envelope) {
  if (envelope.has_samples()) send(envelope.samples());
  if (envelope.has_refusal()) tell(kError, "The bench refuses: " + envelope.refusal().message());
  if (envelope.has_notice()) tell(kWarning, envelope.notice().message());
}

bool FoxgloveSession::next(FoxgloveMessage& message) {
  if (waiting_.empty()) return false;
  message = std::move(waiting_.front());
  waiting_.pop_front();
  waiting_bytes_ -= message.bytes.size();
  return true;
}

void FoxgloveSession::put(bool is_text, std::string bytes) {
  waiting_bytes_ += bytes.size();
  waiting_.push_back({.is_text = is_text, .bytes = std::move(bytes)});
}

void FoxgloveSession::tell(int level, std::string_view sentence, std::string_view id) {
  nlohmann::ordered_json status{{"op", "status"}, {"level", level}, {"message", sentence}};
  if (!id.empty()) status["id"] = id;  // replaces the status before it
  put(true, json_text(status));
}

void FoxgloveSession::send(const v1::Samples& samples) {
  if (samples.axis() >= channels_.size() || !channels_[samples.axis()].is_subscribed) return;
  FoxgloveChannel& channel = channels_[samples.axis()];
  channel.lost += samples.dropped();
  std::uint64_t time_ns = 0;
  for (const v1::Sample& sample : samples.samples()) {
    if (sample.tick() <= channel.last_tick) time_ns_ = 0;  // the bench was set back
    channel.last_tick = sample.tick();
    if (waiting_bytes_ >= kSamplesLimit) {
      ++channel.lost;
      continue;
    }
    if (channel.lost > 0) {
      tell(kWarning,
           fmt::format("{}: {} samples are lost, because this client reads too slowly.", channel.topic,
                       channel.lost),
           channel.topic);
      channel.lost = 0;
    }
    time_ns = static_cast<std::uint64_t>(std::llround(static_cast<double>(sample.tick()) * period_ns_));
    std::string message(1, kMessageData);
    put_little_endian(message, channel.subscription);
    put_little_endian(message, time_ns);
    sample.AppendToString(&message);
    put(false, std::move(message));
  }
  send_time(time_ns);
}

void FoxgloveSession::send_time(std::uint64_t time_ns) {
  if (time_ns <= time_ns_) return;  // another axis was there before
  time_ns_ = time_ns;
  std::string message(1, kTime);
  put_little_endian(message, time_ns);
  put(false, std::move(message));
}

}  // namespace drivebench::web
