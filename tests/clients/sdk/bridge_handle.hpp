#pragma once

#include <drivebench_bridge.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/clients/sdk/leg_setting.hpp"

namespace drivebench::client {

inline constexpr std::uint64_t kMicro = 1'000'000;
inline constexpr std::uint64_t kPeriod = 20 * kMicro;
inline const std::string kEsc = "inproc:" DRIVEBENCH_CONFIGS "/benches/esc.toml";
inline const std::string kBoard = "inproc:" DRIVEBENCH_CONFIGS "/benches/esc-board.toml";

/// A bridge at gate level of a bench in this process.
struct Bridge {
  drivebench_bridge* handle = nullptr;

  explicit Bridge(const std::string& address = kEsc) {
    EXPECT_EQ(drivebench_bridge_open(address.c_str(), 0, &handle), DRIVEBENCH_OK)
        << drivebench_bridge_error(nullptr);
  }
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;
  ~Bridge() { drivebench_bridge_close(handle); }

  std::string error() const { return drivebench_bridge_error(handle); }
  int set(std::uint32_t leg, const drivebench_leg& setting) {
    return drivebench_bridge_set(handle, leg, &setting);
  }
  int run(std::uint64_t until_ps) {
    return drivebench_bridge_run(handle, until_ps, nullptr, 0, nullptr, nullptr);
  }
  drivebench_bridge_state read() {
    drivebench_bridge_state state;
    EXPECT_EQ(drivebench_bridge_read(handle, &state), DRIVEBENCH_OK);
    return state;
  }
  std::vector<std::byte> save() {
    std::size_t size = 0;
    EXPECT_EQ(drivebench_bridge_save(handle, nullptr, &size), DRIVEBENCH_OK);
    std::vector<std::byte> state(size);
    EXPECT_EQ(drivebench_bridge_save(handle, state.data(), &size), DRIVEBENCH_OK);
    return state;
  }
  /// The rotor is pulled along b.
  void align(double duty = 0.1) {
    set(0, leg_at(DRIVEBENCH_LEG_LOW));
    set(1, leg_at(DRIVEBENCH_LEG_PWM, kPeriod,
                  static_cast<std::uint64_t>(duty * static_cast<double>(kPeriod)), 200'000));
    set(2, leg_at(DRIVEBENCH_LEG_OPEN));
  }
};

}  // namespace drivebench::client
