#include "server/endpoints/outbox.hpp"

namespace drivebench {

void Outbox::send(std::span<const std::byte> bytes, const std::shared_ptr<void>& owner) {
  if (!socket_.is_open()) return;
  if (!writing_) {
    boost::system::error_code error;
    const std::size_t written = socket_.write_some(asio::buffer(bytes.data(), bytes.size()), error);
    if (error && error != asio::error::would_block && error != asio::error::try_again) return close();
    bytes = bytes.subspan(error ? 0 : written);
    if (bytes.empty()) return;
  }
  const std::size_t waiting = queued_.size() + in_flight_.size() - sent_;
  if (waiting + bytes.size() > kMaxQueued) return cut("too much waits for it");
  queued_.insert(queued_.end(), bytes.begin(), bytes.end());
  if (!writing_) {
    writing_ = true;
    arm_timer(owner);
    write_more(owner);
  }
}

void Outbox::write_more(const std::shared_ptr<void>& owner) {
  if (sent_ == in_flight_.size()) {
    in_flight_.clear();
    in_flight_.swap(queued_);
    sent_ = 0;
  }
  if (in_flight_.empty()) {
    writing_ = false;
    timer_.cancel();
    if (on_idle) on_idle();
    return;
  }
  socket_.async_write_some(asio::buffer(in_flight_.data() + sent_, in_flight_.size() - sent_),
                           [this, owner](const boost::system::error_code& error, std::size_t written) {
                             if (error) return close();
                             sent_ += written;
                             arm_timer(owner);
                             write_more(owner);
                           });
}

void Outbox::arm_timer(const std::shared_ptr<void>& owner) {
  timer_.expires_after(kNoProgressLimit);
  timer_.async_wait([this, owner](const boost::system::error_code& error) {
    if (!error) cut("it took nothing for 2 s");
  });
}

void Outbox::cut(std::string_view why) {
  if (on_cut && socket_.is_open()) on_cut(why);
  close();
}

void Outbox::close() noexcept {
  boost::system::error_code ignored;
  timer_.cancel(ignored);
  socket_.shutdown(Socket::shutdown_both, ignored);
  socket_.close(ignored);
}

}  // namespace drivebench
