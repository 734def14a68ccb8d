#include "clients/sdk/open_backend.hpp"

#include <dlfcn.h>

#include <cstdlib>
#include <string>

#include "clients/installation/find_file.hpp"
#include "clients/link/can/can_link.hpp"
#include "clients/link/modbus/modbus_link.hpp"
#include "clients/sdk/bus_backend.hpp"
#include "clients/sdk/link_backend.hpp"
#include "clients/sdk/link_bridge.hpp"

namespace drivebench::sdk {
namespace {

constexpr std::string_view kInproc = "inproc:";

/// The library stays loaded: its code must outlive every bench.
const abi::InprocLibrary& load_inproc_library() {
  void* const library = ::dlopen(abi::kInprocLibrary, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    throw OpenError(DRIVEBENCH_NO_BENCH, std::string("inproc: needs the library ") + abi::kInprocLibrary +
                                             ", which comes with drivebench: " + ::dlerror());
  }
  const auto function = reinterpret_cast<abi::InprocFunction>(::dlsym(library, abi::kInprocSymbol));
  if (function == nullptr) {
    throw OpenError(DRIVEBENCH_OTHER_ABI, std::string(abi::kInprocLibrary) + " is no library of drivebench");
  }
  const abi::InprocLibrary& inproc = *function();
  if (std::string_view(inproc.version) != DRIVEBENCH_PROJECT_VERSION ||
      inproc.sample_size != sizeof(drivebench_sample)) {
    throw OpenError(DRIVEBENCH_OTHER_ABI,
                    std::string(abi::kInprocLibrary) + " is of version " + inproc.version +
                        ", libdrivebench of another build: " + DRIVEBENCH_PROJECT_VERSION);
  }
  return inproc;
}

std::string bench_file(std::string_view bench) {
  return installation::find_file("benches", "bench file", bench).string();
}

std::unique_ptr<abi::Backend> open_inproc(std::string_view bench) {
  std::string error;
  const std::string file = bench_file(bench);
  std::unique_ptr<abi::Backend> backend(load_inproc_library().open(file.c_str(), error));
  if (backend == nullptr) throw OpenError(DRIVEBENCH_NO_BENCH, error);
  return backend;
}

std::unique_ptr<abi::Backend> open_any(std::string_view address, const link::LinkOptions& options) {
  const bool is_bus = link::is_can_address(address) || link::is_modbus_address(address);
  if (options.conducts && (is_bus || address.starts_with(kInproc))) {
    throw OpenError(DRIVEBENCH_NOT_AVAILABLE,
                    "conducts works over tcp:, tls:, unix: and shm: only: elsewhere there is no "
                    "other session whose axis could be changed, or no way to ask for it");
  }
  if (address.starts_with(kInproc)) return open_inproc(address.substr(kInproc.size()));
  if (link::is_can_address(address)) {
    return std::make_unique<BusBackend>(std::make_unique<link::CanLink>(
        link::parse_can_address(address), link::CanLinkOptions{.deadline = options.deadline}));
  }
  if (link::is_modbus_address(address)) {
    return std::make_unique<BusBackend>(
        std::make_unique<link::ModbusLink>(link::parse_modbus_address(address), options.deadline));
  }
  return std::make_unique<LinkBackend>(address, options);
}

/// Opens something, and turns what opening throws into OpenError.
template <class Open>
auto open_or_fail(Open open) {
  try {
    return open();
  } catch (const link::AddressError& wrong) {
    throw OpenError(DRIVEBENCH_BAD_ARGUMENT, wrong.what());
  } catch (const link::RefusalError& refusal) {
    throw OpenError(static_cast<int>(refusal.code()), refusal.what());
  } catch (const link::LinkError& none) {
    throw OpenError(DRIVEBENCH_NO_BENCH, none.what());
  } catch (const installation::NotFound& not_found) {
    throw OpenError(DRIVEBENCH_NO_BENCH, not_found.what());
  }
}

std::unique_ptr<abi::Bridge> open_inproc_bridge(std::string_view bench, std::uint32_t axis) {
  int code = DRIVEBENCH_NO_BENCH;
  std::string error;
  const std::string file = bench_file(bench);
  std::unique_ptr<abi::Bridge> bridge(load_inproc_library().open_bridge(file.c_str(), axis, code, error));
  if (bridge == nullptr) throw OpenError(code, error);
  return bridge;
}

/// The token of a bench that wants one comes from the environment, as for the commands.
std::unique_ptr<abi::Bridge> open_shared_bridge(std::string_view address, std::uint32_t axis) {
  const char* const token = std::getenv("DRIVEBENCH_TOKEN");
  return std::make_unique<LinkBridge>(link::parse_address(address), axis,
                                      link::LinkOptions{.token = token == nullptr ? "" : token});
}

}  // namespace

std::unique_ptr<abi::Backend> open_backend(std::string_view address, const link::LinkOptions& options) {
  return open_or_fail([&] { return open_any(address, options); });
}

std::unique_ptr<abi::Bridge> open_bridge(std::string_view address, std::uint32_t axis) {
  return open_or_fail([&] {
    if (address.starts_with(kInproc)) return open_inproc_bridge(address.substr(kInproc.size()), axis);
    if (address.starts_with("shm:")) return open_shared_bridge(address, axis);
    throw OpenError(DRIVEBENCH_NOT_AVAILABLE,
                    "the gate level works in process and through shared memory: the address must be "
                    "inproc:BENCH or shm:PATH, not " +
                        std::string(address));
  });
}

}  // namespace drivebench::sdk
