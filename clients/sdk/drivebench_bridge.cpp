#include "protocols/abi/drivebench_bridge.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clients/sdk/open_backend.hpp"
#include "protocols/abi/bridge.hpp"

struct drivebench_bridge {
  std::unique_ptr<drivebench::abi::Bridge> bridge;
  std::size_t state_size;  // of the program's header
  std::size_t means_size;
};

namespace {

using drivebench::abi::Bridge;

thread_local std::string open_bridge_error;  // of this thread's last drivebench_bridge_open()

int refuse_bridge(int code, std::string sentence) noexcept {
  open_bridge_error = std::move(sentence);
  return code;
}

/// What the call is for, ready for it; null if there is no bridge.
Bridge* ready(drivebench_bridge* bridge) noexcept {
  if (bridge == nullptr) {
    open_bridge_error = "the bridge is a null pointer";
    return nullptr;
  }
  bridge->bridge->forget_error();
  return bridge->bridge.get();
}

int null_argument(Bridge& bridge, const char* name) noexcept {
  return bridge.fail(DRIVEBENCH_BAD_ARGUMENT, std::string(name) + " is a null pointer");
}

/// drivebench_bridge_run() where something is due.
[[gnu::noinline]] int run_on(Bridge& bridge, std::uint64_t until_ps, std::span<drivebench_bridge_edge> edges,
                             std::size_t* count, std::uint64_t* now_ps) noexcept {
  std::size_t written = 0;
  const int code = bridge.run(until_ps, edges, written);
  if (count != nullptr) *count = written;
  if (now_ps != nullptr) *now_ps = bridge.now_ps();
  return code;
}

/// Whether a struct of the program's header is one that this library fills from its start.
constexpr bool fills(std::size_t of_program, std::size_t of_library) noexcept {
  return of_program <= of_library && of_program % 8 == 0;
}

}  // namespace

extern "C" {

int drivebench_bridge_open_abi(const char* address, uint32_t axis, uint32_t abi, size_t state_size,
                               size_t means_size, drivebench_bridge** bridge) {
  if (bridge == nullptr) return refuse_bridge(DRIVEBENCH_BAD_ARGUMENT, "bridge is a null pointer");
  *bridge = nullptr;
  open_bridge_error.clear();
  if (address == nullptr) return refuse_bridge(DRIVEBENCH_BAD_ARGUMENT, "address is a null pointer");
  if (abi != DRIVEBENCH_ABI || !fills(state_size, sizeof(drivebench_bridge_state)) ||
      !fills(means_size, sizeof(drivebench_bridge_means))) {
    return refuse_bridge(DRIVEBENCH_OTHER_ABI,
                         "the program was built with the header of another drivebench: ABI " +
                             std::to_string(abi) + ", this library has ABI " +
                             std::to_string(DRIVEBENCH_ABI));
  }
  try {
    *bridge = std::make_unique<drivebench_bridge>(
                  drivebench_bridge{.bridge = drivebench::sdk::open_bridge(address, axis),
                                    .state_size = state_size,
                                    .means_size = means_size})
                  .release();
    return DRIVEBENCH_OK;
  } catch (const drivebench::sdk::OpenError& failure) {
    return refuse_bridge(failure.code(), failure.what());
  } catch (const std::exception& failure) {
    return refuse_bridge(DRIVEBENCH_FAILED, failure.what());
  }
}

void drivebench_bridge_close(drivebench_bridge* bridge) {
  delete bridge;
}

const char* drivebench_bridge_error(const drivebench_bridge* bridge) {
  return bridge == nullptr ? open_bridge_error.c_str() : bridge->bridge->error().c_str();
}

int drivebench_bridge_set(drivebench_bridge* bridge, uint32_t leg, const drivebench_leg* setting) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  return setting == nullptr ? null_argument(*b, "setting") : b->set(leg, *setting);
}

int drivebench_bridge_run(drivebench_bridge* bridge, uint64_t until_ps, drivebench_bridge_edge* edges,
                          size_t room, size_t* count, uint64_t* now_ps) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (room != 0 && edges == nullptr) return null_argument(*b, "edges");
  if (room != 0 && count == nullptr) return null_argument(*b, "count");
  if (!b->run_idle(until_ps)) return run_on(*b, until_ps, {edges, room}, count, now_ps);
  if (count != nullptr) *count = 0;
  if (now_ps != nullptr) *now_ps = until_ps;
  return DRIVEBENCH_OK;
}

int drivebench_bridge_next_edge(drivebench_bridge* bridge, uint64_t limit_ps, drivebench_bridge_edge* edge,
                                int32_t* found) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (edge == nullptr) return null_argument(*b, "edge");
  if (found == nullptr) return null_argument(*b, "found");
  bool is_there = false;
  const int code = b->next_edge(limit_ps, *edge, is_there);
  *found = is_there ? 1 : 0;
  return code;
}

int drivebench_bridge_read(drivebench_bridge* bridge, drivebench_bridge_state* state) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (state == nullptr) return null_argument(*b, "state");
  drivebench_bridge_state whole;
  const int code = b->read(whole);
  if (code == DRIVEBENCH_OK) std::memcpy(state, &whole, bridge->state_size);
  return code;
}

int drivebench_bridge_mark(drivebench_bridge* bridge) {
  Bridge* const b = ready(bridge);
  return b == nullptr ? DRIVEBENCH_BAD_ARGUMENT : b->mark();
}

int drivebench_bridge_mean(drivebench_bridge* bridge, drivebench_bridge_means* means) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (means == nullptr) return null_argument(*b, "means");
  drivebench_bridge_means whole;
  const int code = b->mean(whole);
  if (code == DRIVEBENCH_OK) std::memcpy(means, &whole, bridge->means_size);
  return code;
}

int drivebench_bridge_set_load(drivebench_bridge* bridge, double load_nm) {
  Bridge* const b = ready(bridge);
  return b == nullptr ? DRIVEBENCH_BAD_ARGUMENT : b->set_load(load_nm);
}

int drivebench_bridge_get_parameter(drivebench_bridge* bridge, const char* name, double* value) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (name == nullptr) return null_argument(*b, "name");
  return value == nullptr ? null_argument(*b, "value") : b->get_parameter(name, *value);
}

int drivebench_bridge_set_parameter(drivebench_bridge* bridge, const char* name, double value) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  return name == nullptr ? null_argument(*b, "name") : b->set_parameter(name, value);
}

int drivebench_bridge_inject(drivebench_bridge* bridge, const char* name, double value) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  return name == nullptr ? null_argument(*b, "name") : b->inject(name, value);
}

int drivebench_bridge_clear(drivebench_bridge* bridge) {
  Bridge* const b = ready(bridge);
  return b == nullptr ? DRIVEBENCH_BAD_ARGUMENT : b->clear();
}

int drivebench_bridge_save(drivebench_bridge* bridge, void* state, size_t* size) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (size == nullptr) return null_argument(*b, "size");
  std::vector<std::byte> saved;
  if (const int code = b->save(saved); code != DRIVEBENCH_OK) return code;
  const std::size_t room = std::exchange(*size, saved.size());
  if (state == nullptr) return DRIVEBENCH_OK;
  if (room < saved.size()) {
    return b->fail(DRIVEBENCH_BAD_ARGUMENT, "size is " + std::to_string(room) + " but the state has " +
                                                std::to_string(saved.size()) + " bytes");
  }
  std::ranges::copy(saved, static_cast<std::byte*>(state));
  return DRIVEBENCH_OK;
}

int drivebench_bridge_restore(drivebench_bridge* bridge, const void* state, size_t size) {
  Bridge* const b = ready(bridge);
  if (b == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (state == nullptr) return null_argument(*b, "state");
  return b->restore({static_cast<const std::byte*>(state), size});
}

}  // extern "C"
