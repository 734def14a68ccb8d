#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "protocols/abi/bridge.hpp"
#include "protocols/abi/drivebench.h"
#include "protocols/signals/sample.hpp"

/// Behind the C ABI (drivebench.h): what a way to a bench can do.
namespace drivebench::abi {

/// One open way to a bench. Requests return a drivebench_code; after a failure error() has the sentence. None
/// of them throws. They mean what the functions of the same name in drivebench.h say.
class Backend {
 public:
  Backend() = default;
  Backend(const Backend&) = delete;
  Backend& operator=(const Backend&) = delete;
  virtual ~Backend() = default;

  virtual const drivebench_description& describe() const noexcept = 0;

  virtual int acquire(std::uint32_t axis) noexcept = 0;
  virtual int renew(std::uint32_t axis) noexcept = 0;
  virtual int release(std::uint32_t axis) noexcept = 0;
  virtual int clear(std::uint32_t axis) noexcept = 0;

  /// At least one command. Afterwards sample() has the next sample of each of their axes.
  virtual int step(std::span<const drivebench_command> commands) noexcept = 0;
  /// Afterwards sample() has the newest sample of the axis.
  virtual int newest(std::uint32_t axis) noexcept = 0;
  /// The sample that step() or newest() has brought for an axis, until the next request.
  virtual const Sample& sample(std::uint32_t axis) const noexcept = 0;

  virtual int get(std::uint32_t axis, const char* name, double& value) noexcept = 0;
  virtual int set(std::uint32_t axis, const char* name, double value, std::uint64_t ramp_ticks,
                  std::uint64_t at_tick) noexcept = 0;
  virtual int set_load(std::uint32_t axis, double load_nm, std::uint64_t ramp_ticks,
                       std::uint64_t at_tick) noexcept = 0;
  virtual int inject(std::uint32_t axis, const char* name, double value, std::uint64_t at_tick) noexcept = 0;
  virtual int bump(std::uint32_t axis, double impulse_nms, std::uint64_t at_tick) noexcept = 0;

  /// An event of describe(), whose number is right.
  virtual int event_tick(std::size_t, std::int64_t&) noexcept {
    return not_over_it("event_tick works in process only (inproc:BENCH)");
  }
  virtual int state_hash(std::uint64_t& hash) noexcept = 0;
  virtual int reset() noexcept { return not_over_it(kNoStates); }
  virtual int save(std::vector<std::byte>&) noexcept { return not_over_it(kNoStates); }
  virtual int restore(std::span<const std::byte>) noexcept { return not_over_it(kNoStates); }

  const std::string& error() const noexcept { return error_; }
  const std::string& error_field() const noexcept { return field_; }
  void forget_error() noexcept {
    error_.clear();
    field_.clear();
  }
  /// Keeps the sentence for error() and returns the code.
  int fail(int code, std::string sentence, std::string field = {}) noexcept {
    error_ = std::move(sentence);
    field_ = std::move(field);
    return code;
  }

 private:
  static constexpr const char* kNoStates =
      "reset, save and restore work in process and over tcp, tls, unix and shm; this link does not have them";

  int not_over_it(const char* sentence) noexcept { return fail(DRIVEBENCH_NOT_AVAILABLE, sentence); }

  std::string error_;
  std::string field_;
};

/// What drivebench_inproc() of the in-process library returns: a bench behind the ABI. libdrivebench loads it
/// while the program runs, because clients do not link the plant.
struct InprocLibrary {
  const char* version;  ///< of drivebench; both libraries come from the same build
  std::size_t sample_size;
  /// Opens the bench file. Null after a failure, whose sentence is then in `error`.
  Backend* (*open)(const char* bench_file, std::string& error) noexcept;
  /// The same of an axis at gate level; `code` is then a drivebench_code.
  Bridge* (*open_bridge)(const char* bench_file, std::uint32_t axis, int& code, std::string& error) noexcept;
};
inline constexpr const char* kInprocLibrary = "libdrivebench-inproc.so.1";
inline constexpr const char* kInprocSymbol = "drivebench_inproc";
using InprocFunction = const InprocLibrary* (*)() noexcept;

}  // namespace drivebench::abi
