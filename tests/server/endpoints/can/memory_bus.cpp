#include "tests/server/endpoints/can/memory_bus.hpp"
#include "protocols/can/formats/kernel_frame.hpp"
#include "server/endpoints/can/buses/error_report.hpp"

#include <algorithm>
#include <utility>

#include "server/endpoints/can/buses/send_queue.hpp"

namespace drivebench::can {
namespace {

bool is_off(BusState state) noexcept {
  return state == BusState::kDown || state == BusState::kAbsent;
}

}  // namespace

/// One port.
class MemoryBus final : public Bus {
 public:
  MemoryBus(MemoryWire& wire, std::string name) : wire_(&wire), name_(std::move(name)) {
    status_.state = wire.link_;
    wire.ports_.push_back(this);
  }
  ~MemoryBus() override {
    if (wire_ == nullptr) return;
    std::erase(wire_->ports_, this);
    std::erase_if(wire_->under_way_, [this](const auto& passage) { return passage.from == this; });
  }

  void send(const Frame& frame) override {
    if (wire_ == nullptr || is_off(status_.state)) {
      ++status_.send_dropped;
    } else if (wire_->full_) {
      status_.send_dropped += pending_.push(frame);
    } else {
      transmit(frame);
    }
  }
  void set_filter(const std::vector<std::uint32_t>& ids) override {
    ids_ = ids;
    std::sort(ids_.begin(), ids_.end());
    filtered_ = true;
  }
  const BusStatus& status() const noexcept override { return status_; }
  std::string name() const override { return "memory:" + name_; }

 private:
  friend class MemoryWire;

  void transmit(const Frame& frame) {
    ++status_.sent;
    wire_->carry(this, frame);
  }
  void flush() {
    for (; !pending_.empty(); pending_.pop())
      transmit(pending_.front());
  }
  void hear(const Frame& frame) {
    if (filtered_ && !std::binary_search(ids_.begin(), ids_.end(), frame.id)) return;
    status_.receive_dropped += std::exchange(lost_, 0);
    ++status_.received;
    if (on_frame) on_frame(frame, 0);
  }
  void set_state(BusState state) {
    if (is_off(state)) status_.send_dropped += pending_.clear();
    if (std::exchange(status_.state, state) == state) return;
    asio::post(wire_->io_, [this, alive = std::weak_ptr(alive_)] {
      if (!alive.expired() && on_state) on_state();
    });
  }

  MemoryWire* wire_;  ///< nothing once the wire is gone
  std::string name_;
  BusStatus status_;
  SendQueue pending_;
  std::vector<std::uint32_t> ids_;
  bool filtered_ = false;
  std::uint64_t lost_ = 0;  ///< not yet told
  std::shared_ptr<const bool> alive_ = std::make_shared<const bool>();
};

MemoryWire::~MemoryWire() {
  for (MemoryBus* port : ports_)
    port->wire_ = nullptr;
}

std::unique_ptr<Bus> MemoryWire::connect(std::string name) {
  return std::make_unique<MemoryBus>(*this, std::move(name));
}

void MemoryWire::set_link(BusState state) {
  link_ = state;
  if (state == BusState::kUp) to_lose_ = 0;
  if (is_off(state)) under_way_.clear();
  for (MemoryBus* port : ports_)
    port->set_state(state);
}

void MemoryWire::set_full(bool full) {
  full_ = full;
  if (full) return;
  for (MemoryBus* port : ports_)
    port->flush();
}

void MemoryWire::report(Frame error) {
  error.error = true;
  for (MemoryBus* port : ports_) {
    ++port->status_.error_frames;
    port->set_state(state_after(error, port->status_.state));
  }
}

void MemoryWire::carry(const MemoryBus* from, const Frame& frame) {
  if (to_lose_ > 0) {
    --to_lose_;
    for (MemoryBus* port : ports_)
      if (port != from) ++port->lost_;
    return;
  }
  under_way_.push_back({.from = from, .frame = frame});
  if (std::exchange(posted_, true)) return;
  asio::post(io_, [this, alive = std::weak_ptr(alive_)] {
    if (!alive.expired()) deliver();
  });
}

void MemoryWire::deliver() {
  posted_ = false;
  for (const Passage& passage : std::exchange(under_way_, {})) {
    if (is_off(link_)) return;
    // By number: a listener may make or end a port.
    for (std::size_t i = 0; i < ports_.size(); ++i)
      if (ports_[i] != passage.from) ports_[i]->hear(passage.frame);
  }
}

}  // namespace drivebench::can
