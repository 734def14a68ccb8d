#include <exception>
#include <memory>
#include <string>
#include <utility>

#include "server/inproc/inproc_bench.hpp"
#include "server/inproc/inproc_bridge.hpp"

namespace drivebench {
namespace {

abi::Backend* open_bench(const char* bench_file, std::string& error) noexcept {
  try {
    return std::make_unique<InprocBench>(load_inproc_config(bench_file)).release();
  } catch (const std::exception& failure) {
    error = failure.what();
    return nullptr;
  }
}

abi::Bridge* open_bridge(const char* bench_file, std::uint32_t axis, int& code, std::string& error) noexcept {
  try {
    const BenchConfig config = load_inproc_config(bench_file);
    InprocBridge::Problem problem = InprocBridge::problem_with(config, axis);
    code = problem.code;
    error = std::move(problem.sentence);
    if (code == DRIVEBENCH_OK) return std::make_unique<InprocBridge>(config, axis).release();
  } catch (const std::exception& failure) {
    code = DRIVEBENCH_NO_BENCH;
    error = failure.what();
  }
  return nullptr;
}

}  // namespace
}  // namespace drivebench

extern "C" __attribute__((visibility("default"))) const drivebench::abi::InprocLibrary*
drivebench_inproc() noexcept {
  static constexpr drivebench::abi::InprocLibrary kLibrary = {.version = DRIVEBENCH_PROJECT_VERSION,
                                                              .sample_size = sizeof(drivebench_sample),
                                                              .open = drivebench::open_bench,
                                                              .open_bridge = drivebench::open_bridge};
  return &kLibrary;
}
