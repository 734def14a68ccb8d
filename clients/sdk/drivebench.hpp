/// drivebench.hpp: the C ABI (drivebench.h) for C++20, header-only. A failure throws Error.
#pragma once

#include <drivebench.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace drivebench::client {

/// A drivebench_command whose members are 0 unless named.
struct Command {
  std::uint32_t axis = 0;
  std::uint32_t gates = DRIVEBENCH_GATES_OFF;
  std::uint64_t tick = 0;
  double setpoint_a = 0.0;
  double setpoint_b = 0.0;
  double setpoint_c = 0.0;
  double setpoint_f = 0.0;
  std::uint64_t legs_off = 0;
  std::array<std::array<drivebench_edge, DRIVEBENCH_MAX_EDGES>, 3> edges{};

  drivebench_command to_c() const noexcept { return std::bit_cast<drivebench_command>(*this); }
};

using Description = drivebench_description;
using Options = drivebench_options;
using Sample = drivebench_sample;

/// The bench refused a request, or could not be reached: what() is the sentence.
class Error : public std::runtime_error {
 public:
  Error(int code, const char* sentence, const char* field)
      : std::runtime_error(sentence), code_(code), field_(field) {}
  int code() const noexcept { return code_; }  ///< a drivebench_code
  const std::string& field() const noexcept {
    return field_;
  }  ///< the field that the refusal names, or empty

 private:
  int code_;
  std::string field_;
};

/// An open bench, for one thread at a time. See drivebench.h for addresses, units and signs. Every method
/// throws Error.
class Bench {
 public:
  explicit Bench(const std::string& address, const Options& options = {}) {
    drivebench_bench* opened = nullptr;
    check(drivebench_open(address.c_str(), &options, &opened));
    bench_.reset(opened);
  }

  const Description& describe() const noexcept { return *drivebench_describe(bench_.get()); }

  void acquire(std::uint32_t axis = 0) { check(drivebench_acquire(bench_.get(), axis)); }
  void renew(std::uint32_t axis = 0) { check(drivebench_renew(bench_.get(), axis)); }
  void release(std::uint32_t axis = 0) { check(drivebench_release(bench_.get(), axis)); }
  void clear(std::uint32_t axis = 0) { check(drivebench_clear(bench_.get(), axis)); }

  /// One axis: its command, and its next sample.
  Sample step(const Command& command) {
    Sample sample;
    step(command, sample);
    return sample;
  }
  /// The same into a sample of the caller's, which is kept if the step fails.
  void step(const Command& command, Sample& sample) {
    const drivebench_command wanted = command.to_c();
    check(drivebench_step(bench_.get(), &wanted, 1, &sample));
  }
  /// Several axes: samples[i] belongs to commands[i].
  void step(std::span<const Command> commands, std::span<Sample> samples) {
    if (samples.size() != commands.size()) {
      throw Error(DRIVEBENCH_BAD_ARGUMENT, "step() needs room for one sample for each command", "samples");
    }
    commands_.clear();
    for (const Command& command : commands)
      commands_.push_back(command.to_c());
    check(drivebench_step(bench_.get(), commands_.data(), commands_.size(), samples.data()));
  }
  Sample newest(std::uint32_t axis = 0) const {
    Sample sample;
    check(drivebench_newest(bench_.get(), axis, &sample));
    return sample;
  }

  double get(const std::string& parameter, std::uint32_t axis = 0) const {
    double value = 0.0;
    check(drivebench_get(bench_.get(), axis, parameter.c_str(), &value));
    return value;
  }
  /// When a change acts: at once, or at a tick; as a step, or in a ramp.
  struct When {
    std::uint64_t ramp_ticks = 0;
    std::uint64_t at_tick = 0;
  };
  void set(const std::string& parameter, double value, std::uint32_t axis = 0, const When& when = {0, 0}) {
    check(drivebench_set(bench_.get(), axis, parameter.c_str(), value, when.ramp_ticks, when.at_tick));
  }
  void set_load(double load_nm, std::uint32_t axis = 0, const When& when = {0, 0}) {
    check(drivebench_set_load(bench_.get(), axis, load_nm, when.ramp_ticks, when.at_tick));
  }
  void inject(const std::string& fault, double value, std::uint32_t axis = 0, std::uint64_t at_tick = 0) {
    check(drivebench_inject(bench_.get(), axis, fault.c_str(), value, at_tick));
  }
  void bump(double impulse_nms, std::uint32_t axis = 0, std::uint64_t at_tick = 0) {
    check(drivebench_bump(bench_.get(), axis, impulse_nms, at_tick));
  }

  /// The tick in which an event of describe() acted; nothing: not yet.
  std::optional<std::int64_t> event_tick(std::size_t event) const {
    std::int64_t tick = 0;
    check(drivebench_event_tick(bench_.get(), event, &tick));
    return tick < 0 ? std::nullopt : std::optional(tick);
  }
  std::uint64_t state_hash() const {
    std::uint64_t hash = 0;
    check(drivebench_state_hash(bench_.get(), &hash));
    return hash;
  }
  void reset() { check(drivebench_reset(bench_.get())); }
  std::vector<std::byte> save() const {
    std::size_t size = 0;
    check(drivebench_save(bench_.get(), nullptr, &size));
    std::vector<std::byte> state(size);
    check(drivebench_save(bench_.get(), state.data(), &size));
    return state;
  }
  void restore(std::span<const std::byte> state) {
    check(drivebench_restore(bench_.get(), state.data(), state.size()));
  }

 private:
  struct Close {
    void operator()(drivebench_bench* bench) const noexcept { drivebench_close(bench); }
  };

  void check(int code) const {
    if (code == DRIVEBENCH_OK) return;
    throw Error(code, drivebench_error(bench_.get()), drivebench_error_field(bench_.get()));
  }

  std::unique_ptr<drivebench_bench, Close> bench_;
  std::vector<drivebench_command> commands_;  // of the present step
};

}  // namespace drivebench::client
