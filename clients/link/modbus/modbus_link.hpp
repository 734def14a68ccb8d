#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "clients/link/common/axis_link.hpp"

struct _modbus;

namespace drivebench::link {

/// An axis of a bench that speaks Modbus TCP.
struct ModbusAddress {
  std::string host;
  std::string port;
  int unit = 1;
};

bool is_modbus_address(std::string_view text) noexcept;

/// `modbus:HOST[:PORT][?unit=N]`; without a port 1502. Throws AddressError.
ModbusAddress parse_modbus_address(std::string_view text);

/// The link of a controller over the registers of protocols/modbus/register_map.hpp: one transaction writes
/// the command and reads the sample, with real values as float32. A part of the truth does not fit into the
/// transaction and is unknown.
class ModbusLink final : public AxisLink {
 public:
  /// Connects and reads the header of the map. Throws ConnectError, RefusalError, LinkError.
  explicit ModbusLink(const ModbusAddress& address,
                      std::chrono::milliseconds deadline = std::chrono::seconds(5));
  /// Releases the axis if it is still held.
  ~ModbusLink() override;

  const v1::BenchDescription& bench() const noexcept override { return bench_; }
  std::uint32_t axis() const noexcept override { return 0; }
  SignalMask known() const noexcept override;

  void acquire() override;
  void release() override;
  void clear_faults() override;
  const Sample& newest() override;
  const Sample& exchange(const AxisCommand& command) override;
  void write_parameter(std::string_view name, double value) override;
  bool can_set_load() const noexcept override { return false; }
  void set_load(const LoadChange& change) override;

 private:
  struct Free {
    void operator()(_modbus* context) const noexcept;
  };

  void describe();
  void read(std::uint16_t start, std::span<std::uint16_t> words);
  void write(std::uint16_t address, std::uint16_t value);
  void check(int result, std::string_view doing);
  [[noreturn]] void refuse_busy();

  std::string name_;
  std::chrono::milliseconds deadline_;
  std::unique_ptr<_modbus, Free> modbus_;
  v1::BenchDescription bench_;
  bool writes_allowed_ = false;
  std::uint16_t key_;
  bool holds_axis_ = false;
  bool commands_legs_ = false;  ///< a command has switched a leg off
  Sample sample_;
};

}  // namespace drivebench::link
