#include "server/messages/register_writer.hpp"

#include <modbus/modbus.h>

#include <cerrno>
#include <memory>
#include <utility>

namespace drivebench {
namespace {

constexpr std::uint32_t kPatience_us = 500'000;  ///< for the connection, and for the answer

struct Free {
  void operator()(modbus_t* context) const noexcept {
    modbus_close(context);
    modbus_free(context);
  }
};

std::string write_registers(const RegisterMessage& message) {
  const std::unique_ptr<modbus_t, Free> context(
      modbus_new_tcp_pi(message.address.c_str(), std::to_string(message.port).c_str()));
  if (context == nullptr) return modbus_strerror(errno);
  modbus_set_response_timeout(context.get(), 0, kPatience_us);
  if (modbus_set_slave(context.get(), message.unit) != 0 || modbus_connect(context.get()) != 0)
    return modbus_strerror(errno);
  const auto count = static_cast<int>(message.values.size());
  const int written =
      count == 1 ? modbus_write_register(context.get(), message.first, message.values.front())
                 : modbus_write_registers(context.get(), message.first, count, message.values.data());
  return written == count ? std::string() : std::string(modbus_strerror(errno));
}

}  // namespace

void RegisterWriter::write(const RegisterMessage& message, Done done) {
  const std::lock_guard lock(mutex_);
  jobs_.push_back({message, std::move(done)});
  changed_.notify_all();
}

void RegisterWriter::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return jobs_.empty() && !is_busy_; });
}

void RegisterWriter::run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return !jobs_.empty(); })) {
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    is_busy_ = true;
    lock.unlock();
    job.done(write_registers(job.message));
    lock.lock();
    is_busy_ = false;
    changed_.notify_all();
  }
}

}  // namespace drivebench
