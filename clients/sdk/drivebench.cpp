#include "protocols/abi/drivebench.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clients/sdk/open_backend.hpp"
#include "protocols/abi/backend.hpp"

struct drivebench_bench {
  std::unique_ptr<drivebench::abi::Backend> backend;
  std::size_t sample_size;  // of the program's header
  bool clears_on_acquire;
};

namespace {

using drivebench::abi::Backend;

thread_local std::string open_error;  // of this thread's last drivebench_open()

int refuse_to_open(int code, std::string sentence) noexcept {
  open_error = std::move(sentence);
  return code;
}

drivebench::link::LinkOptions link_options(const drivebench_options& o) {
  drivebench::link::LinkOptions options{.client = o.client != nullptr ? o.client : "libdrivebench"};
  const char* const token = o.token != nullptr ? o.token : std::getenv("DRIVEBENCH_TOKEN");
  if (token != nullptr) options.token = token;
  options.conducts = o.conducts != 0;
  if (o.deadline_ms != 0) options.deadline = std::chrono::milliseconds(o.deadline_ms);
  return options;
}

/// The back end, ready for a request; null if there is no bench.
Backend* begin(drivebench_bench* bench) noexcept {
  if (bench == nullptr) {
    open_error = "the bench is a null pointer";
    return nullptr;
  }
  bench->backend->forget_error();
  return bench->backend.get();
}

int refuse_null(Backend& backend, const char* name) noexcept {
  return backend.fail(DRIVEBENCH_BAD_ARGUMENT, std::string(name) + " is a null pointer", name);
}

/// Writes the part of a sample that the program's header knows.
void hand_out(const drivebench_bench& bench, std::uint32_t axis, void* sample) noexcept {
  std::memcpy(sample, &bench.backend->sample(axis), bench.sample_size);
}

}  // namespace

extern "C" {

int drivebench_open_abi(const char* address, const drivebench_options* options, uint32_t abi,
                        size_t sample_size, drivebench_bench** bench) {
  if (bench == nullptr) return refuse_to_open(DRIVEBENCH_BAD_ARGUMENT, "bench is a null pointer");
  *bench = nullptr;
  open_error.clear();
  if (address == nullptr) return refuse_to_open(DRIVEBENCH_BAD_ARGUMENT, "address is a null pointer");
  if (abi != DRIVEBENCH_ABI || sample_size > sizeof(drivebench_sample) || sample_size % 8 != 0) {
    return refuse_to_open(DRIVEBENCH_OTHER_ABI,
                          "the program was built with the header of another drivebench: ABI " +
                              std::to_string(abi) + " with " + std::to_string(sample_size / 8) +
                              " signals, this library has ABI " + std::to_string(DRIVEBENCH_ABI) + " with " +
                              std::to_string(sizeof(drivebench_sample) / 8));
  }
  try {
    const drivebench_options chosen = options != nullptr ? *options : drivebench_options{};
    auto opened = std::make_unique<drivebench_bench>(
        drivebench_bench{.backend = drivebench::sdk::open_backend(address, link_options(chosen)),
                         .sample_size = sample_size,
                         .clears_on_acquire = chosen.clear_on_acquire != 0});
    *bench = opened.release();
    return DRIVEBENCH_OK;
  } catch (const drivebench::sdk::OpenError& failure) {
    return refuse_to_open(failure.code(), failure.what());
  } catch (const std::exception& failure) {
    return refuse_to_open(DRIVEBENCH_FAILED, failure.what());
  }
}

void drivebench_close(drivebench_bench* bench) {
  delete bench;
}

const char* drivebench_error(const drivebench_bench* bench) {
  return bench == nullptr ? open_error.c_str() : bench->backend->error().c_str();
}

const char* drivebench_error_field(const drivebench_bench* bench) {
  return bench == nullptr ? "" : bench->backend->error_field().c_str();
}

const drivebench_description* drivebench_describe(const drivebench_bench* bench) {
  return bench == nullptr ? nullptr : &bench->backend->describe();
}

int drivebench_acquire(drivebench_bench* bench, uint32_t axis) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  const int code = backend->acquire(axis);
  return code == DRIVEBENCH_OK && bench->clears_on_acquire ? backend->clear(axis) : code;
}

int drivebench_renew(drivebench_bench* bench, uint32_t axis) {
  Backend* const backend = begin(bench);
  return backend == nullptr ? DRIVEBENCH_BAD_ARGUMENT : backend->renew(axis);
}

int drivebench_release(drivebench_bench* bench, uint32_t axis) {
  Backend* const backend = begin(bench);
  return backend == nullptr ? DRIVEBENCH_BAD_ARGUMENT : backend->release(axis);
}

int drivebench_clear(drivebench_bench* bench, uint32_t axis) {
  Backend* const backend = begin(bench);
  return backend == nullptr ? DRIVEBENCH_BAD_ARGUMENT : backend->clear(axis);
}

int drivebench_step(drivebench_bench* bench, const drivebench_command* commands, size_t count,
                    drivebench_sample* samples) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (commands == nullptr) return refuse_null(*backend, "commands");
  if (count == 0)
    return backend->fail(DRIVEBENCH_BAD_ARGUMENT, "count is 0: a step needs a command", "count");
  if (const int code = backend->step({commands, count}); code != DRIVEBENCH_OK) return code;
  for (std::size_t i = 0; samples != nullptr && i < count; ++i)
    hand_out(*bench, commands[i].axis, reinterpret_cast<char*>(samples) + i * bench->sample_size);
  return DRIVEBENCH_OK;
}

int drivebench_newest(drivebench_bench* bench, uint32_t axis, drivebench_sample* sample) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (sample == nullptr) return refuse_null(*backend, "sample");
  const int code = backend->newest(axis);
  if (code == DRIVEBENCH_OK) hand_out(*bench, axis, sample);
  return code;
}

int drivebench_get(drivebench_bench* bench, uint32_t axis, const char* name, double* value) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (name == nullptr) return refuse_null(*backend, "name");
  if (value == nullptr) return refuse_null(*backend, "value");
  return backend->get(axis, name, *value);
}

int drivebench_set(drivebench_bench* bench, uint32_t axis, const char* name, double value,
                   uint64_t ramp_ticks, uint64_t at_tick) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (name == nullptr) return refuse_null(*backend, "name");
  return backend->set(axis, name, value, ramp_ticks, at_tick);
}

int drivebench_set_load(drivebench_bench* bench, uint32_t axis, double load_nm, uint64_t ramp_ticks,
                        uint64_t at_tick) {
  Backend* const backend = begin(bench);
  return backend == nullptr ? DRIVEBENCH_BAD_ARGUMENT : backend->set_load(axis, load_nm, ramp_ticks, at_tick);
}

int drivebench_inject(drivebench_bench* bench, uint32_t axis, const char* name, double value,
                      uint64_t at_tick) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (name == nullptr) return refuse_null(*backend, "name");
  return backend->inject(axis, name, value, at_tick);
}

int drivebench_bump(drivebench_bench* bench, uint32_t axis, double impulse_nms, uint64_t at_tick) {
  Backend* const backend = begin(bench);
  return backend == nullptr ? DRIVEBENCH_BAD_ARGUMENT : backend->bump(axis, impulse_nms, at_tick);
}

int drivebench_event_tick(drivebench_bench* bench, size_t event, int64_t* tick) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (tick == nullptr) return refuse_null(*backend, "tick");
  const std::size_t count = backend->describe().event_count;
  if (event < count) return backend->event_tick(event, *tick);
  return backend->fail(DRIVEBENCH_BAD_ARGUMENT,
                       "event is " + std::to_string(event) + " but the description has " +
                           std::to_string(count) + (count == 1 ? " event" : " events"),
                       "event");
}

int drivebench_state_hash(drivebench_bench* bench, uint64_t* hash) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  return hash == nullptr ? refuse_null(*backend, "hash") : backend->state_hash(*hash);
}

int drivebench_reset(drivebench_bench* bench) {
  Backend* const backend = begin(bench);
  return backend == nullptr ? DRIVEBENCH_BAD_ARGUMENT : backend->reset();
}

int drivebench_save(drivebench_bench* bench, void* state, size_t* size) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (size == nullptr) return refuse_null(*backend, "size");
  std::vector<std::byte> saved;
  if (const int code = backend->save(saved); code != DRIVEBENCH_OK) return code;
  const std::size_t room = std::exchange(*size, saved.size());
  if (state == nullptr) return DRIVEBENCH_OK;
  if (room < saved.size()) {
    return backend->fail(
        DRIVEBENCH_BAD_ARGUMENT,
        "size is " + std::to_string(room) + " but the state has " + std::to_string(saved.size()) + " bytes",
        "size");
  }
  std::ranges::copy(saved, static_cast<std::byte*>(state));
  return DRIVEBENCH_OK;
}

int drivebench_restore(drivebench_bench* bench, const void* state, size_t size) {
  Backend* const backend = begin(bench);
  if (backend == nullptr) return DRIVEBENCH_BAD_ARGUMENT;
  if (state == nullptr) return refuse_null(*backend, "state");
  return backend->restore({static_cast<const std::byte*>(state), size});
}

const char* drivebench_version(void) {
  return DRIVEBENCH_PROJECT_VERSION;
}

}  // extern "C"
