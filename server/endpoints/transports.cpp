#include "server/endpoints/transports.hpp"

namespace drivebench {

Transports::Transports(asio::io_context& io, const BenchConfig& config) {
  for (const CanConfig& bus : config.can)
    can_.push_back(std::make_unique<can::Endpoint>(io, bus, can::open_bus(io, bus)));
  if (config.modbus.enabled) modbus_ = std::make_unique<ModbusServer>(io, config.modbus);
}

void Transports::serve(Engine& engine, Audit* audit) {
  for (const auto& bus : can_)
    bus->serve(engine, audit);
  if (modbus_) modbus_->serve(engine, audit);
}

std::vector<TransportReport> Transports::reports() const {
  std::vector<TransportReport> reports;
  for (const auto& bus : can_)
    reports.push_back(bus->report());
  if (modbus_) reports.push_back(modbus_->report());
  return reports;
}

void Transports::close() {
  for (const auto& bus : can_)
    bus->close();
  if (modbus_) modbus_->close();
}

std::vector<std::string> Transports::can_names() const {
  std::vector<std::string> names;
  for (const auto& bus : can_)
    names.push_back(bus->name());
  return names;
}

std::string Transports::modbus_address() const {
  return modbus_ ? modbus_->address() : std::string();
}

}  // namespace drivebench
