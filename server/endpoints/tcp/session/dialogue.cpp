#include "server/endpoints/tcp/session/dialogue.hpp"

#include <algorithm>

#include "protocols/framing.hpp"
#include "protocols/text.hpp"

namespace drivebench {

v1::RefusalCode code_of(Refused why) noexcept {
  return static_cast<v1::RefusalCode>(refusal_row(why).tcp);
}

Dialogue::Dialogue(Outbox::Socket socket, Client client, SessionContext& context,
                   std::function<std::shared_ptr<void>()> keep_alive)
    : socket_(std::move(socket)),
      outbox_(socket_, context.outboxes),
      client_(std::move(client)),
      context_(context),
      keep_alive_(std::move(keep_alive)) {
  socket_.non_blocking(true);
}

v1::Envelope& Dialogue::begin_reply(std::uint64_t id) {
  context_.reply.Clear();
  context_.reply.set_id(id);
  return context_.reply;
}

void Dialogue::send_reply() {
  encode_reply();
  send_scratch();
}

std::vector<std::byte>& Dialogue::encode_reply() {
  const v1::Envelope& envelope = context_.reply;
  std::vector<std::byte>& bytes = context_.scratch;
  const std::size_t size = envelope.ByteSizeLong();
  bytes.resize(kFrameHeaderSize + size);
  const auto header = frame_header(static_cast<std::uint32_t>(size));
  std::copy(header.begin(), header.end(), bytes.begin());
  envelope.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(bytes.data()) + kFrameHeaderSize);
  bytes_in_turn_ += bytes.size();
  return bytes;
}

void Dialogue::send_scratch() {
  outbox_.send(context_.scratch, keep_alive_());
}

void Dialogue::done(std::uint64_t id, Tick tick) {
  v1::Done& done = *begin_reply(id).mutable_done();
  done.set_tick(static_cast<std::uint64_t>(tick));
  done.set_owner(owner_);
  send_reply();
}

void Dialogue::refuse(std::uint64_t id, v1::RefusalCode code, const std::string& message, const char* field) {
  v1::Refusal& refusal = *begin_reply(id).mutable_refusal();
  refusal.set_code(code);
  refusal.set_message(utf8(message));  // a file name in it may not be UTF-8
  refusal.set_field(field);
  send_reply();
}

void Dialogue::refuse(std::uint64_t id, Refused why, const char* field) {
  refuse(id, why, std::string(sentence_of(why)), field);
}

void Dialogue::refuse(std::uint64_t id, Refused why, const std::string& sentence, const char* field) {
  if (lacks_lease(why)) note_not_owner(why);
  refuse(id, code_of(why), sentence, field);
}

void Dialogue::note_not_owner(Refused why) {
  ++context_.counts.not_owner;
  context_.log.note(client_, "not the owner", sentence_of(why));
}

void Dialogue::notify(v1::Notice::Kind kind, const std::string& sentence, std::uint32_t axis) {
  v1::Notice& notice = *begin_reply(0).mutable_notice();
  notice.set_kind(kind);
  notice.set_message(sentence);
  notice.set_axis(axis);
  send_reply();
}

void Dialogue::report(std::string_view event, std::string_view kind, std::string_view why,
                      std::vector<AuditDetail> details) {
  context_.log.note(client_, kind, why);
  audit(event, why, std::move(details));
}

void Dialogue::audit(std::string_view event, std::string_view result, std::vector<AuditDetail> details) {
  if (context_.audit == nullptr) return;
  context_.audit->note({.name = event, .client = &client_, .result = result, .details = std::move(details)});
}

bool Dialogue::axis_exists(std::uint32_t axis) {
  if (axis < axis_count()) return true;
  refuse(id(), v1::REFUSAL_UNKNOWN_AXIS, no_such_axis(axis), "axis");
  return false;
}

std::string Dialogue::no_such_axis(std::uint64_t axis) const {
  return "axis " + std::to_string(axis) + " does not exist; the bench has " + std::to_string(axis_count());
}

}  // namespace drivebench
