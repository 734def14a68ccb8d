#include "server/endpoints/tcp/session/identity.hpp"

#include <algorithm>
#include <utility>

#include "server/access/address.hpp"

namespace drivebench {
namespace {

Role role_needed_for(const v1::Envelope& request) {
  switch (request.kind_case()) {
    case v1::Envelope::kHello:
    case v1::Envelope::kSubscribe:
    case v1::Envelope::kTrigger:
    case v1::Envelope::kReadCapture:
    case v1::Envelope::kReadParameters:
    case v1::Envelope::kStatusRequest:
    case v1::Envelope::kListExperiments:
    case v1::Envelope::kFetchExperiment:
      return Role::kViewer;
    case v1::Envelope::kExchange:
      return request.exchange().commands().empty() ? Role::kViewer : Role::kOperator;
    case v1::Envelope::kLease:
      return request.lease().action() == v1::LeaseRequest::ACTION_TAKE ? Role::kAdmin : Role::kOperator;
    default:
      return Role::kOperator;
  }
}

}  // namespace

Identity::Identity(Dialogue& dialogue) : dialogue_(dialogue), slot_timer_(dialogue.socket().get_executor()) {}

bool Identity::admit(const v1::Hello& hello) {
  SessionContext& context = dialogue_.context();
  Client& client = dialogue_.client();
  const Admission::Decision decision = context.admission.admit(
      hello.token(), address_of(client), ServerClock::now(), std::chrono::system_clock::now());
  if (!decision.admitted) {
    ++context.counts.wrong_tokens;
    dialogue_.report("authentication", "not admitted", decision.why_not, {{"client", hello.client()}});
    dialogue_.refuse(dialogue_.id(), v1::REFUSAL_UNAUTHENTICATED, decision.why_not, "token");
    return false;
  }
  grant_ = decision.grant;
  if (!grant_.name.empty()) client.subject = grant_.name;  // otherwise the name of the certificate stays
  if (hello.conducts() && !is_at_least(Role::kConductor, "conducts")) return false;
  dialogue_.set_conducts(hello.conducts());
  return true;
}

bool Identity::may_ask(const v1::Envelope& request) {
  const auto* kind = v1::Envelope::descriptor()->FindFieldByNumber(static_cast<int>(request.kind_case()));
  return is_at_least(role_needed_for(request), kind == nullptr ? "kind" : kind->name());
}

bool Identity::is_at_least(Role needed, const std::string& field) {
  if (grant_.role >= needed) return true;
  forbidden().use();
  asked_forbidden_ = true;
  dialogue_.report("forbidden", "forbidden", "the role does not allow it", {{"request", field}});
  dialogue_.refuse(dialogue_.id(), v1::REFUSAL_FORBIDDEN,
                   "this session is that of " + (grant_.name.empty() ? "an unnamed user" : grant_.name) +
                       ", a " + std::string(name_of(grant_.role)) + "; this request needs the role " +
                       std::string(name_of(needed)),
                   field.c_str());
  return false;
}

Allowance& Identity::forbidden() {
  auto& of_users = dialogue_.context().forbidden;
  return of_users.try_emplace(grant_.name, kForbidden, ServerClock::now()).first->second;
}

bool Identity::must_pause() {
  return asked_forbidden_ && forbidden().left(ServerClock::now()) < 0.0;
}

ServerClock::duration Identity::pause() {
  if (!std::exchange(asked_forbidden_, false)) return {};
  return std::min<ServerClock::duration>(forbidden().wait(ServerClock::now()), kLongestPause);
}

/// The slot ends at a wall time, but a jump of the wall clock does not move a running timer.
void Identity::watch_slot() {
  slot_timer_.cancel();
  if (!grant_.until) return;
  slot_timer_.expires_after(
      std::chrono::duration_cast<ServerClock::duration>(*grant_.until - std::chrono::system_clock::now()));
  slot_timer_.async_wait([this, session = dialogue_.keep_alive()](const boost::system::error_code& error) {
    if (!error) on_end("the time of " + grant_.name + " is over");
  });
}

void Identity::look_again() {
  const Grant* const now = dialogue_.context().admission.renewed(grant_, std::chrono::system_clock::now());
  if (now == nullptr) return on_end("the token of " + grant_.name + " holds no more");
  if (now->role != grant_.role || now->name != grant_.name) {
    return on_end("the token of " + grant_.name + " means something else now: say hello again");
  }
  grant_ = *now;
  watch_slot();
}

}  // namespace drivebench
