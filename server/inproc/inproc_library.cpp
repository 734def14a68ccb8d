#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/config/config.hpp"
#include "server/config/sections/plausible.hpp"
#include "server/inproc/inproc_bench.hpp"

namespace drivebench {
namespace {

abi::Backend* open_bench(const char* bench_file, std::string& error) noexcept {
  try {
    std::vector<ConfigProblem> odd;
    const BenchConfig config = load_config(bench_file, odd);
    if (!odd.empty()) throw ConfigError(std::move(odd));
    return std::make_unique<InprocBench>(config).release();
  } catch (const std::exception& failure) {
    error = failure.what();
    return nullptr;
  }
}

}  // namespace
}  // namespace drivebench

extern "C" __attribute__((visibility("default"))) const drivebench::abi::InprocLibrary*
drivebench_inproc() noexcept {
  static constexpr drivebench::abi::InprocLibrary kLibrary = {.version = DRIVEBENCH_PROJECT_VERSION,
                                                              .sample_size = sizeof(drivebench_sample),
                                                              .open = drivebench::open_bench};
  return &kLibrary;
}
