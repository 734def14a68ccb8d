#include "server/endpoints/tcp/sending/audience.hpp"

#include <algorithm>

namespace drivebench {
namespace {

template <class Member>
void add_once(std::vector<Member*>& members, Member& member) {
  if (std::find(members.begin(), members.end(), &member) == members.end()) members.push_back(&member);
}

}  // namespace

void Audience::add_subscriber(Viewer& viewer) {
  add_once(subscribers_, viewer);
}

void Audience::remove_subscriber(const Viewer& viewer) {
  std::erase(subscribers_, &viewer);
}

void Audience::add_waiting(Waiter& waiter) {
  add_once(waiting_, waiter);
}

void Audience::remove_waiting(const Waiter& waiter) {
  std::erase(waiting_, &waiter);
}

void Audience::add_watcher(Watcher& watcher) {
  add_once(watchers_, watcher);
}

void Audience::remove_watcher(const Watcher& watcher) {
  std::erase(watchers_, &watcher);
}

std::shared_ptr<const SampleFeed> Audience::feed(std::uint32_t axis, std::uint32_t decimation) {
  drop_unread_feeds();
  for (const auto& feed : feeds_) {
    if (feed->axis() == axis && feed->decimation() == decimation) return feed;
  }
  if (decimation > 1) {
    const auto decimated = std::ranges::count_if(feeds_, [](const auto& f) { return f->decimation() > 1; });
    if (static_cast<std::size_t>(decimated) == kMostDecimatedFeeds) return nullptr;
  }
  return feeds_.emplace_back(std::make_shared<SampleFeed>(axis, decimation, engine_.newest(axis).tick));
}

void Audience::drop_unread_feeds() {
  std::erase_if(feeds_, [](const auto& feed) { return feed.use_count() == 1; });
}

void Audience::on_set_back() {
  for (const auto& feed : feeds_)
    feed->begin_anew(engine_.newest(feed->axis()));
  for (Watcher* const watcher : watchers_)
    watcher->on_set_back();
}

void Audience::on_tick() {
  drop_unread_feeds();
  for (const auto& feed : feeds_)
    feed->take(engine_.newest(feed->axis()));
  for (Watcher* const watcher : watchers_)
    watcher->on_tick();
  if (++ticks_behind_ % kTicksBehind == 0) send_all();
}

void Audience::on_newest() {
  ticks_behind_ = 0;
  answered_.clear();
  answered_.swap(waiting_);
  for (Waiter* const waiter : answered_)
    waiter->on_newest();
  if (!turn_to_come_) take_turn();
}

void Audience::send_all() {
  for (Viewer* const viewer : subscribers_)
    viewer->send_samples();
}

/// Goes on with turns until no subscriber has samples and takes them.
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
