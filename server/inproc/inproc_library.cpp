#include <exception>
#include <memory>
#include <string>

#include "server/inproc/inproc_bench.hpp"

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

}  // namespace
}  // namespace drivebench

extern "C" __attribute__((visibility("default"))) const drivebench::abi::InprocLibrary*
drivebench_inproc() noexcept {
  static constexpr drivebench::abi::InprocLibrary kLibrary = {.version = DRIVEBENCH_PROJECT_VERSION,
                                                              .sample_size = sizeof(drivebench_sample),
                                                              .open = drivebench::open_bench};
  return &kLibrary;
}
