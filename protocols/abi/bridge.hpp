#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "protocols/abi/drivebench_bridge.h"

namespace drivebench::abi {

/// A bridge behind drivebench_bridge.h. Requests return a drivebench_code; after a failure error() has the
/// sentence and nothing has changed. They mean what the functions of the same name in the header say.
class Bridge {
 public:
  Bridge() = default;
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;
  virtual ~Bridge() = default;

  virtual int set(std::uint32_t leg, const drivebench_leg& setting) noexcept = 0;
  virtual int run(std::uint64_t until_ps, std::span<drivebench_bridge_edge> edges,
                  std::size_t& count) noexcept = 0;
  virtual int next_edge(std::uint64_t limit_ps, drivebench_bridge_edge& edge, bool& found) noexcept = 0;
  virtual int read(drivebench_bridge_state& state) noexcept = 0;
  virtual int mark() noexcept = 0;
  virtual int mean(drivebench_bridge_means& means) noexcept = 0;
  virtual int set_load(double load_nm) noexcept = 0;
  virtual int get_parameter(const char* name, double& value) noexcept = 0;
  virtual int set_parameter(const char* name, double value) noexcept = 0;
  virtual int inject(const char* name, double value) noexcept = 0;
  virtual int clear() noexcept = 0;
  virtual int save(std::vector<std::byte>& state) noexcept = 0;
  virtual int restore(std::span<const std::byte> state) noexcept = 0;

  std::uint64_t now_ps() const noexcept { return now_ps_; }
  /// run() where it takes no time, which most do: nothing is due up to there. Else it does nothing and is
  /// false.
  bool run_idle(std::uint64_t until_ps) noexcept {
    const bool is_idle = until_ps >= now_ps_ && until_ps < due_ps_;
    if (is_idle) now_ps_ = until_ps;
    return is_idle;
  }

  const std::string& error() const noexcept { return error_; }
  void forget_error() noexcept { error_.clear(); }
  /// Keeps the sentence for error() and returns the code.
  int fail(int code, std::string sentence) noexcept {
    error_ = std::move(sentence);
    return code;
  }

 protected:
  /// Time is here, and nothing is due before `due_ps`; 0 if that is not known.
  void set_time(std::uint64_t now_ps, std::uint64_t due_ps) noexcept {
    now_ps_ = now_ps;
    due_ps_ = due_ps;
  }

 private:
  std::uint64_t now_ps_ = 0;
  std::uint64_t due_ps_ = 0;
  std::string error_;
};

}  // namespace drivebench::abi
