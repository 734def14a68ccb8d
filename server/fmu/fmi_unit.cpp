#include "server/fmu/fmi_unit.hpp"

#include <cstring>
#include <span>
#include <stdexcept>

namespace drivebench::fmi {

Status Unit::told(int code) const {
  if (code == DRIVEBENCH_OK) return kOk;
  return tell(code == DRIVEBENCH_CAUSE_LASTS ? kWarning : kError, bench->error());
}

bool open_bench(Unit& unit, const std::filesystem::path& resources, const char* token) {
  try {
    unit.bench = std::make_unique<FmuInstance>(resources / "bench.toml");
    if (token != nullptr && unit.bench->token() == token) return true;
    unit.tell(kError, "the model description is of another bench: its token must be " + unit.bench->token());
  } catch (const std::exception& failure) {
    unit.tell(kError, failure.what());
  }
  return false;
}

Status none_of(void* instance, std::size_t count, const char* type) noexcept {
  if (count == 0) return kOk;
  return guarded(instance, [type](Unit& unit) {
    return unit.tell(kError, std::string("this unit has no variables of type ") + type);
  });
}

Status not_there(void* instance, const char* what) noexcept {
  return guarded(instance,
                 [what](Unit& unit) { return unit.tell(kError, std::string("this unit has no ") + what); });
}

Status keep_state(void* instance, void** state) noexcept {
  return guarded(instance, [state](Unit& unit) {
    auto saved = std::make_unique<Saved>(unit.bench->save());
    delete static_cast<Saved*>(*state);  // the importer may hand in an older one for reuse
    *state = saved.release();
    return kOk;
  });
}

Status go_back(void* instance, void* state) noexcept {
  return guarded(instance, [state](Unit& unit) {
    if (state == nullptr) return unit.tell(kError, "there is no state to go back to");
    return unit.told(unit.bench->restore(*static_cast<Saved*>(state)));
  });
}

Status free_state(void* instance, void** state) noexcept {
  return guarded(instance, [state](Unit&) {
    if (state == nullptr) return kOk;
    delete static_cast<Saved*>(*state);
    *state = nullptr;
    return kOk;
  });
}

Status state_size(void* instance, void* state, std::size_t* size) noexcept {
  return guarded(instance, [&](Unit& unit) {
    if (state == nullptr) return unit.tell(kError, "there is no state to measure");
    *size = static_cast<Saved*>(state)->size();
    return kOk;
  });
}

Status write_state(void* instance, void* state, void* bytes, std::size_t size) noexcept {
  return guarded(instance, [&](Unit& unit) {
    if (state == nullptr) return unit.tell(kError, "there is no state to write");
    const Saved& saved = *static_cast<Saved*>(state);
    if (size < saved.size()) {
      return unit.tell(kError, "the state has " + std::to_string(saved.size()) + " bytes, the room " +
                                   std::to_string(size));
    }
    std::memcpy(bytes, saved.data(), saved.size());
    return kOk;
  });
}

Status read_state(void* instance, const void* bytes, std::size_t size, void** state) noexcept {
  return guarded(instance, [&](Unit&) {
    const auto whole = std::span(static_cast<const std::byte*>(bytes), size);
    *state = std::make_unique<Saved>(whole.begin(), whole.end()).release();
    return kOk;
  });
}

}  // namespace drivebench::fmi
