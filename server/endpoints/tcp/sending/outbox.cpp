#include "server/endpoints/tcp/sending/outbox.hpp"

#include <algorithm>
#include <string>

#include "server/endpoints/lost_peer.hpp"

namespace drivebench {

void Outbox::send(std::span<const std::byte> bytes, const std::shared_ptr<void>& owner) {
  if (!socket_.is_open()) return;
  if (!writing_) {
    boost::system::error_code error;
    const std::size_t written = socket_.write_some(asio::buffer(bytes.data(), bytes.size()), error);
    if (error && error != asio::error::would_block && error != asio::error::try_again) return lose(error);
    bytes = bytes.subspan(error ? 0 : written);
    if (bytes.empty()) return;
  }
  if (waiting_ + bytes.size() > limit()) return cut("too much waits for it");
  queue(bytes);
  if (!writing_) {
    writing_ = true;
    expect_progress(owner);
    write_more(owner);
  }
}

/// Queues in chunks, so that sent bytes take no memory and waiting bytes are never moved.
void Outbox::queue(std::span<const std::byte> bytes) {
  constexpr std::size_t kChunk = std::size_t{16} * 1024;
  waiting_ += bytes.size();
  pool_->bytes += bytes.size();
  while (!bytes.empty()) {
    if (chunks_.empty() || chunks_.back().size() == chunks_.back().capacity()) {
      chunks_.emplace_back().reserve(kChunk);
    }
    std::vector<std::byte>& last = chunks_.back();
    const auto fits = bytes.first(std::min(bytes.size(), last.capacity() - last.size()));
    last.insert(last.end(), fits.begin(), fits.end());
    bytes = bytes.subspan(fits.size());
  }
}

std::size_t Outbox::limit() const noexcept {
  const std::size_t free = OutboxPool::kMaxBytes - std::min(pool_->bytes, OutboxPool::kMaxBytes);
  return std::clamp(free, kAlwaysQueued, kMaxQueued);
}

void Outbox::forget(std::size_t bytes) noexcept {
  waiting_ -= bytes;
  pool_->bytes -= bytes;
}

void Outbox::write_more(const std::shared_ptr<void>& owner) {
  if (!chunks_.empty() && sent_ == chunks_.front().size()) {
    chunks_.pop_front();
    sent_ = 0;
  }
  if (chunks_.empty()) {
    writing_ = false;
    deadline_.call_off();
    if (on_idle) on_idle();
    return;
  }
  const std::vector<std::byte>& first = chunks_.front();
  socket_.async_write_some(asio::buffer(first.data() + sent_, first.size() - sent_),
                           [this, owner](const boost::system::error_code& error, std::size_t written) {
                             if (error) return lose(error);
                             if (!socket_.is_open()) return close();
                             sent_ += written;
                             forget(written);
                             expect_progress(owner);
                             write_more(owner);
                           });
}

void Outbox::expect_progress(const std::shared_ptr<void>& owner) {
  deadline_.set(kNoProgressLimit, [this, owner] { cut_deaf(); });
}

void Outbox::cut_deaf() {
  cut("it took nothing for " + std::to_string(kNoProgressLimit.count()) + " s");
}

void Outbox::lose(const boost::system::error_code& error) {
  if (!is_given_up(error)) return close();
  cut("its computer acknowledged nothing for " + std::to_string(kUserTimeoutMs / 1000) + " s");
}

void Outbox::cut(std::string_view why) {
  if (on_cut && socket_.is_open()) on_cut(why);
  close();
}

void Outbox::close() noexcept {
  boost::system::error_code ignored;
  deadline_.call_off();
  socket_.shutdown(Socket::shutdown_both, ignored);
  socket_.close(ignored);
  forget(waiting_);
  chunks_.clear();  // no write reads them any longer
}

}  // namespace drivebench
