#pragma once

#include <memory>
#include <span>
#include <vector>

#include "clients/link/tcp/tcp_link.hpp"
#include "protocols/abi/bridge.hpp"

namespace drivebench::sdk {

/// A bridge at gate level in the server behind a unix socket, through shared memory.
class LinkBridge final : public abi::Bridge {
 public:
  /// `address` is shm:PATH?spin_us=N. Throws as link::Link does.
  LinkBridge(link::Address address, std::uint32_t axis, const link::LinkOptions& options);

  int set(std::uint32_t leg, const drivebench_leg& setting) noexcept override;
  int run(std::uint64_t until_ps, std::span<drivebench_bridge_edge> edges,
          std::size_t& count) noexcept override;
  int next_edge(std::uint64_t limit_ps, drivebench_bridge_edge& edge, bool& found) noexcept override;
  int read(drivebench_bridge_state& state) noexcept override;
  int mark() noexcept override;
  int mean(drivebench_bridge_means& means) noexcept override;
  int set_load(double load_nm) noexcept override;
  int get_parameter(const char* name, double& value) noexcept override;
  int set_parameter(const char* name, double value) noexcept override;
  int inject(const char* name, double value) noexcept override;
  int clear() noexcept override;
  int save(std::vector<std::byte>& state) noexcept override;
  int restore(std::span<const std::byte> state) noexcept override;

 private:
  /// Has a call carried out; `take` sees the results if it was not refused.
  template <class Take>
  int ask(const shm::BridgeArguments& call, Take take) noexcept;
  int ask(const shm::BridgeArguments& call) noexcept;
  int ask_by_name(shm::BridgeCall call, const char* name, double value, double* result) noexcept;

  link::Link link_;
  std::unique_ptr<link::BridgeMemory> memory_;
};

}  // namespace drivebench::sdk
