// Who is behind a session, what he may do, and when that ends.
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/endpoints/tcp/session.hpp"

namespace drivebench {
namespace {

/// Where a peer comes from, for those who guess tokens: its address without the port; of IPv6 the network,
/// which is what one computer has. All unix sockets are one place.
std::string address_of(const Client& client) {
  if (client.transport != "tcp") return client.transport;
  std::string address = client.peer.substr(0, client.peer.rfind(':'));
  boost::system::error_code error;
  const asio::ip::address_v6 v6 = asio::ip::make_address_v6(address, error);
  if (error) return address;
  if (v6.is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, v6).to_string();
  asio::ip::address_v6::bytes_type bytes = v6.to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), static_cast<unsigned char>(0));
  return asio::ip::address_v6(bytes).to_string();
}

}  // namespace

/// Refuses the present request if the role of the session does not allow it.
bool Session::may_ask() {
  Role needed = Role::kOperator;
  switch (request_.kind_case()) {
    case v1::Envelope::kHello:
    case v1::Envelope::kSubscribe:
    case v1::Envelope::kReadParameters:
    case v1::Envelope::kStatusRequest:
    case v1::Envelope::kListExperiments:
    case v1::Envelope::kFetchExperiment:
      needed = Role::kViewer;
      break;
    case v1::Envelope::kExchange:
      if (request_.exchange().commands().empty()) needed = Role::kViewer;
      break;
    case v1::Envelope::kLease:
      if (request_.lease().action() == v1::LeaseRequest::ACTION_TAKE) needed = Role::kAdmin;
      break;
    default:
      break;
  }
  if (grant_.role >= needed) return true;
  const auto* kind = v1::Envelope::descriptor()->FindFieldByNumber(static_cast<int>(request_.kind_case()));
  const std::string field = kind == nullptr ? "kind" : kind->name();
  audit("forbidden", "the role does not allow it", {{"request", field}});
  refuse(request_.id(), v1::REFUSAL_FORBIDDEN,
         "this session is that of " + (grant_.name.empty() ? "nobody" : grant_.name) + ", a " +
             std::string(name_of(grant_.role)) + "; this needs the role " + std::string(name_of(needed)),
         field.c_str());
  return false;
}

bool Session::is_admitted(const v1::Hello& hello) {
  const Admission::Decision decision = context_.admission.admit(
      hello.token(), address_of(client_), ServerClock::now(), std::chrono::system_clock::now());
  if (decision.admitted) {
    grant_ = decision.grant;
    if (!grant_.name.empty()) client_.subject = grant_.name;  // else what his certificate says
    return true;
  }
  ++context_.counts.wrong_tokens;
  if (context_.wrong_token_log.allow()) {
    spdlog::warn("{}: {} ({} more since the last such line)", name_of(client_), decision.why_not,
                 context_.wrong_token_log.held_back());
  }
  audit("authentication", decision.why_not, {{"client", hello.client()}});
  refuse(request_.id(), v1::REFUSAL_UNAUTHENTICATED, decision.why_not, "token");
  return false;
}

/// The slot is a wall time, but once it runs no jump of the wall clock moves it.
void Session::watch_slot() {
  slot_timer_.cancel();
  if (!grant_.until) return;
  slot_timer_.expires_after(
      std::chrono::duration_cast<ServerClock::duration>(*grant_.until - std::chrono::system_clock::now()));
  slot_timer_.async_wait([self = shared_from_this()](const boost::system::error_code& error) {
    if (!error) self->end("the time of " + self->grant_.name + " is over");
  });
}

void Session::on_new_grants() {
  if (!greeted_ || over_) return;
  const Grant* const now = context_.admission.renewed(grant_, std::chrono::system_clock::now());
  if (now == nullptr) return end("the token of " + grant_.name + " holds no more");
  if (now->role != grant_.role || now->name != grant_.name) {
    return end("the token of " + grant_.name + " means something else now: say hello again");
  }
  grant_ = *now;
  watch_slot();
}

void Session::end(const std::string& sentence) {
  why_ended_ = sentence;
  notify(v1::Notice::KIND_SESSION_ENDED, sentence, 0);
  close();
}

void Session::take(const v1::LeaseRequest& r, Engine::Answer answer) {
  constexpr std::size_t kMaxReason = 200;
  if (r.reason().empty() || r.reason().size() > kMaxReason) {
    return refuse(request_.id(), v1::REFUSAL_OUT_OF_RANGE,
                  "who takes an axis by force gives a reason of 1 to 200 bytes, not of " +
                      std::to_string(r.reason().size()),
                  "reason");
  }
  // A number that is newer than that of the owner before, so that numbers tell the order.
  const bool may_hold =
      leases_in_flight_ > 0 || std::find(leased_.begin(), leased_.end(), true) != leased_.end();
  if (owner_ == 0 || !may_hold) owner_ = engine_.new_owner(client_);
  ++leases_in_flight_;
  engine_.take(r.axis(), owner_, r.reason(), std::move(answer));
}

void Session::on_taken(const Taken& taken) {
  if (taken.from != owner_ || !leased_[taken.axis]) return;
  const Client* const by = engine_.client(taken.by);
  const std::string sentence = "axis " + std::to_string(taken.axis) + " was taken by " +
                               (by == nullptr ? "an administrator" : name_of(*by)) + ": " + taken.reason;
  leased_[taken.axis] = false;
  taken_[taken.axis] = sentence;
  notify(v1::Notice::KIND_LEASE_TAKEN, sentence, taken.axis);
  abandon_exchange(taken.axis);
}

}  // namespace drivebench
