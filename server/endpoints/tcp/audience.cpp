#include "server/endpoints/tcp/audience.hpp"

#include <algorithm>

#include "server/endpoints/tcp/session.hpp"

namespace drivebench {
namespace {

void add_once(std::vector<Session*>& sessions, Session& session) {
  if (std::find(sessions.begin(), sessions.end(), &session) == sessions.end()) sessions.push_back(&session);
}

}  // namespace

void Audience::add_subscriber(Session& session) {
  add_once(subscribers_, session);
}

void Audience::remove_subscriber(const Session& session) {
  std::erase(subscribers_, &session);
}

void Audience::add_waiting(Session& session) {
  add_once(waiting_, session);
}

void Audience::remove(const Session& session) {
  remove_subscriber(session);
  std::erase(waiting_, &session);
}

std::shared_ptr<const SampleFeed> Audience::feed(std::uint32_t axis, std::uint32_t decimation) {
  drop_unread_feeds();
  for (const auto& feed : feeds_) {
    if (feed->axis() == axis && feed->decimation() == decimation) return feed;
  }
  return feeds_.emplace_back(std::make_shared<SampleFeed>(axis, decimation, engine_.newest(axis).tick));
}

void Audience::drop_unread_feeds() {
  std::erase_if(feeds_, [](const auto& feed) { return feed.use_count() == 1; });
}

void Audience::on_tick() {
  drop_unread_feeds();
  for (const auto& feed : feeds_)
    feed->take(engine_.newest(feed->axis()));
  if (++ticks_behind_ % kTicksBehind == 0) send_all();
}

void Audience::on_newest() {
  ticks_behind_ = 0;
  answered_.clear();
  answered_.swap(waiting_);
  for (Session* const session : answered_)
    session->on_newest();
  if (!turn_to_come_) take_turn();
}

void Audience::send_all() {
  for (Session* const session : subscribers_)
    session->send_samples();
}

/// Ends when nobody is left who has samples and takes them.
void Audience::take_turn() {
  turn_to_come_ = false;
  int served = 0;
  for (std::size_t looked_at = 0; looked_at < subscribers_.size() && served < kSessionsPerTurn; ++looked_at) {
    next_ = (next_ + 1) % subscribers_.size();
    served += subscribers_[next_]->send_samples() ? 1 : 0;
  }
  if (served < kSessionsPerTurn) return;
  turn_to_come_ = true;
  next_turn_.expires_after(kPause);
  next_turn_.async_wait([this](const boost::system::error_code& error) {
    if (!error) take_turn();
  });
}

}  // namespace drivebench
