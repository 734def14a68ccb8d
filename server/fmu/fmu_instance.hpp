#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "protocols/fmi/fmu_variables.hpp"
#include "server/inproc/inproc_bench.hpp"

namespace drivebench {

/// A bench as an importer of a Functional Mock-up Unit sees it: variables by number, and time in seconds. It
/// is the controller of all its axes. Requests return a drivebench_code; after a failure error() is the
/// sentence.
class FmuInstance {
 public:
  /// Opens the bench file. Throws ConfigError.
  explicit FmuInstance(const std::filesystem::path& bench_file);

  const std::vector<fmi::Variable>& variables() const noexcept { return variables_; }
  std::string token() const { return fmi::token_of(bench_.describe()); }

  /// The time at tick 0, 0 unless set.
  int start_at(double time_s);
  /// Where the last step ended.
  double time_s() const noexcept { return time_s_; }
  /// Runs every tick that ends at or before `from_s + step_s`, a millionth of a period early or late: with
  /// steps shorter than a period some calls run none. Inputs hold for all of them.
  int advance(double from_s, double step_s);

  /// A variable of any type but an output of 64 bits. The number must be right.
  double value(std::size_t variable) const;
  /// The bits of an output of 64 bits.
  std::uint64_t word(std::size_t variable) const noexcept;
  int set(std::size_t variable, double value);

  /// Back to the start: tick 0, and every variable as it was then.
  int reset();
  std::vector<std::byte> save();
  int restore(std::span<const std::byte> state);

  const std::string& error() const noexcept { return error_; }

 private:
  /// What the importer has set, and where its time begins: saved with the bench.
  struct Header {
    std::uint64_t magic = kMagic;
    std::uint64_t inputs = 0;
    double start_s = 0.0;
    double time_s = 0.0;
  };
  static constexpr std::uint64_t kMagic = 0x3156'4d46'4244'0a0d;

  int acquire_all();
  int fail(int code, std::string sentence);
  /// Keeps the sentence of the bench.
  int checked(int code);
  void take_start_values();
  std::vector<drivebench_command> commands();
  std::uint64_t tick() const noexcept { return bench_.sample(0).tick; }

  InprocBench bench_;
  fmi::IsCommanded is_commanded_;
  std::vector<fmi::Variable> variables_;
  std::vector<double> set_;  ///< what the importer has set, by variable
  std::vector<drivebench_command> commands_;
  double start_s_ = 0.0;
  double time_s_ = 0.0;  ///< where the last step ended
  std::uint64_t latched_ = 0;
  std::string error_;
};

}  // namespace drivebench
