// The functions of FMI 2.0 for co-simulation, as its standard declares them (section 4.3). C calls them.
#include <algorithm>
#include <cstddef>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "server/fmu/fmi_unit.hpp"
#include "server/fmu/fmi_uri.hpp"

namespace {

using namespace drivebench::fmi;

// The standard's types, with its layouts.
using Component = void*;
using Environment = void*;
using State = void*;
using Reference = unsigned;
using Real = double;
using Integer = int;
using Boolean = int;
using String = const char*;
enum Kind { kModelExchange, kCoSimulation };
struct Callbacks {
  void (*logger)(Environment, String instance, Status, String category, String message, ...);
  void* (*allocate_memory)(std::size_t, std::size_t);
  void (*free_memory)(void*);
  void (*step_finished)(Environment, Status);
  Environment environment;
};

template <class Value>
Status check(const Unit& unit, Reference reference) {
  if constexpr (std::is_same_v<Value, Integer>) {
    return check_reference(unit, reference, "Integer", Type::kInt32);
  } else {
    return check_reference(unit, reference, "Real", Type::kReal, Type::kInt64, Type::kUInt64);
  }
}

template <class Value>
Status get_all(Component component, std::span<const Reference> references, Value* values) noexcept {
  return guarded(component, [&](Unit& unit) {
    for (std::size_t k = 0; k < references.size(); ++k) {
      if (const Status status = check<Value>(unit, references[k]); status != kOk) return status;
      values[k] = static_cast<Value>(unit.bench->value(references[k]));
    }
    return kOk;
  });
}

template <class Value>
Status set_all(Component component, std::span<const Reference> references, const Value* values) noexcept {
  return guarded(component, [&](Unit& unit) {
    Status worst = kOk;
    for (std::size_t k = 0; k < references.size(); ++k) {
      if (const Status status = check<Value>(unit, references[k]); status != kOk) return status;
      worst = std::max(worst, unit.told(unit.bench->set(references[k], values[k])));
    }
    return worst;
  });
}

std::unique_ptr<Unit> opened(String name, Kind kind, String token, String resources,
                             const Callbacks& callbacks, Boolean logs) {
  auto unit = std::make_unique<Unit>();
  unit->logs_warnings = logs != 0;
  unit->log = [callbacks, name = std::string(name != nullptr ? name : "")](Status status,
                                                                           const std::string& sentence) {
    if (callbacks.logger == nullptr) return;
    callbacks.logger(callbacks.environment, name.c_str(), status, category_of(status), "%s",
                     sentence.c_str());
  };
  try {
    if (kind != kCoSimulation) throw std::invalid_argument("this unit is for co-simulation only");
    if (resources == nullptr) throw std::invalid_argument("the importer has given no resource location");
    return open_bench(*unit, drivebench::folder_of_uri(resources), token) ? std::move(unit) : nullptr;
  } catch (const std::invalid_argument& wrong) {
    unit->tell(kError, wrong.what());
    return nullptr;
  }
}

}  // namespace

// NOLINTBEGIN(readability-identifier-naming): the names are those of the standard
extern "C" {

#define FMI2 __attribute__((visibility("default")))

FMI2 const char* fmi2GetTypesPlatform() {
  return "default";
}
FMI2 const char* fmi2GetVersion() {
  return "2.0";
}

FMI2 Status fmi2SetDebugLogging(Component component, Boolean on, std::size_t, const String*) {
  return guarded(component, [on](Unit& unit) {
    unit.logs_warnings = on != 0;
    return kOk;
  });
}

FMI2 Component fmi2Instantiate(String name, Kind kind, String token, String resources,
                               const Callbacks* callbacks, Boolean, Boolean logs) {
  if (callbacks == nullptr) return nullptr;
  try {
    return opened(name, kind, token, resources, *callbacks, logs).release();
  } catch (const std::exception&) {
    return nullptr;  // not even memory for a sentence
  }
}

FMI2 void fmi2FreeInstance(Component component) {
  delete static_cast<Unit*>(component);
}

FMI2 Status fmi2SetupExperiment(Component component, Boolean, Real, Real start_s, Boolean, Real) {
  return guarded(component, [start_s](Unit& unit) { return unit.told(unit.bench->start_at(start_s)); });
}
FMI2 Status fmi2EnterInitializationMode(Component component) {
  return guarded(component, [](Unit&) { return kOk; });
}
FMI2 Status fmi2ExitInitializationMode(Component component) {
  return guarded(component, [](Unit&) { return kOk; });
}
FMI2 Status fmi2Terminate(Component component) {
  return guarded(component, [](Unit&) { return kOk; });
}
FMI2 Status fmi2Reset(Component component) {
  return guarded(component, [](Unit& unit) { return unit.told(unit.bench->reset()); });
}

FMI2 Status fmi2GetReal(Component component, const Reference* references, std::size_t count, Real* values) {
  return get_all(component, {references, count}, values);
}
FMI2 Status fmi2GetInteger(Component component, const Reference* references, std::size_t count,
                           Integer* values) {
  return get_all(component, {references, count}, values);
}
FMI2 Status fmi2GetBoolean(Component component, const Reference*, std::size_t count, Boolean*) {
  return none_of(component, count, "Boolean");
}
FMI2 Status fmi2GetString(Component component, const Reference*, std::size_t count, String*) {
  return none_of(component, count, "String");
}
FMI2 Status fmi2SetReal(Component component, const Reference* references, std::size_t count,
                        const Real* values) {
  return set_all(component, {references, count}, values);
}
FMI2 Status fmi2SetInteger(Component component, const Reference* references, std::size_t count,
                           const Integer* values) {
  return set_all(component, {references, count}, values);
}
FMI2 Status fmi2SetBoolean(Component component, const Reference*, std::size_t count, const Boolean*) {
  return none_of(component, count, "Boolean");
}
FMI2 Status fmi2SetString(Component component, const Reference*, std::size_t count, const String*) {
  return none_of(component, count, "String");
}

FMI2 Status fmi2GetFMUstate(Component component, State* state) {
  return keep_state(component, state);
}
FMI2 Status fmi2SetFMUstate(Component component, State state) {
  return go_back(component, state);
}
FMI2 Status fmi2FreeFMUstate(Component component, State* state) {
  return free_state(component, state);
}
FMI2 Status fmi2SerializedFMUstateSize(Component component, State state, std::size_t* size) {
  return state_size(component, state, size);
}
FMI2 Status fmi2SerializeFMUstate(Component component, State state, char* bytes, std::size_t size) {
  return write_state(component, state, bytes, size);
}
FMI2 Status fmi2DeSerializeFMUstate(Component component, const char* bytes, std::size_t size, State* state) {
  return read_state(component, bytes, size, state);
}

FMI2 Status fmi2GetDirectionalDerivative(Component component, const Reference*, std::size_t, const Reference*,
                                         std::size_t, const Real*, Real*) {
  return not_there(component, "directional derivatives");
}
FMI2 Status fmi2SetRealInputDerivatives(Component component, const Reference*, std::size_t, const Integer*,
                                        const Real*) {
  return not_there(component, "derivatives of inputs");
}
FMI2 Status fmi2GetRealOutputDerivatives(Component component, const Reference*, std::size_t, const Integer*,
                                         Real*) {
  return not_there(component, "derivatives of outputs");
}

FMI2 Status fmi2DoStep(Component component, Real from_s, Real step_s, Boolean) {
  return guarded(component, [&](Unit& unit) { return unit.told(unit.bench->advance(from_s, step_s)); });
}
FMI2 Status fmi2CancelStep(Component component) {
  return not_there(component, "steps in the background");
}
FMI2 Status fmi2GetStatus(Component component, int, Status*) {
  return not_there(component, "steps in the background");
}
FMI2 Status fmi2GetRealStatus(Component component, int, Real* last_s) {
  return guarded(component, [last_s](Unit& unit) {
    *last_s = unit.bench->time_s();
    return kOk;
  });
}
FMI2 Status fmi2GetIntegerStatus(Component component, int, Integer*) {
  return not_there(component, "a status of type Integer");
}
FMI2 Status fmi2GetBooleanStatus(Component component, int, Boolean* terminated) {
  return guarded(component, [terminated](Unit&) {
    *terminated = 0;
    return kOk;
  });
}
FMI2 Status fmi2GetStringStatus(Component component, int, String*) {
  return not_there(component, "a status of type String");
}

}  // extern "C"
// NOLINTEND(readability-identifier-naming)
