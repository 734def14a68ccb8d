// The functions of FMI 3.0 for co-simulation, as its standard declares them (sections 2 and 4). C calls them.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "server/fmu/fmi_unit.hpp"

namespace {

using namespace drivebench::fmi;

// The standard's types, with its layouts.
using Instance = void*;
using Environment = void*;
using State = void*;
using Reference = std::uint32_t;
using String = const char*;
using LogMessage = void (*)(Environment, Status, String category, String message);
using IntermediateUpdate = void (*)(Environment, double, bool, bool, bool, bool, bool*, double*);

template <class Value>
struct TypeOf;
template <>
struct TypeOf<double> {
  static constexpr Type kType = Type::kReal;
  static constexpr const char* kWord = "Float64";
};
template <>
struct TypeOf<std::int32_t> {
  static constexpr Type kType = Type::kInt32;
  static constexpr const char* kWord = "Int32";
};
template <>
struct TypeOf<std::int64_t> {
  static constexpr Type kType = Type::kInt64;
  static constexpr const char* kWord = "Int64";
};
template <>
struct TypeOf<std::uint64_t> {
  static constexpr Type kType = Type::kUInt64;
  static constexpr const char* kWord = "UInt64";
};

template <class Value>
Value value_of(const Unit& unit, Reference reference) {
  if constexpr (sizeof(Value) == 8 && !std::is_same_v<Value, double>) {
    return static_cast<Value>(unit.bench->word(reference));
  } else {
    return static_cast<Value>(unit.bench->value(reference));
  }
}

/// All variables are scalars: as many values as references.
Status check_counts(const Unit& unit, std::size_t references, std::size_t values) {
  if (references == values) return kOk;
  return unit.tell(kError,
                   std::to_string(references) + " variables have no " + std::to_string(values) + " values");
}

template <class Value>
Status get_all(Instance instance, std::span<const Reference> references, Value* values,
               std::size_t count) noexcept {
  return guarded(instance, [&](Unit& unit) {
    if (const Status status = check_counts(unit, references.size(), count); status != kOk) return status;
    for (std::size_t k = 0; k < count; ++k) {
      if constexpr (std::is_same_v<Value, double>) {
        if (references[k] == unit.bench->variables().size()) {  // the independent variable
          values[k] = unit.bench->time_s();
          continue;
        }
      }
      const Status status = check_reference(unit, references[k], TypeOf<Value>::kWord, TypeOf<Value>::kType);
      if (status != kOk) return status;
      values[k] = value_of<Value>(unit, references[k]);
    }
    return kOk;
  });
}

template <class Value>
Status set_all(Instance instance, std::span<const Reference> references, const Value* values,
               std::size_t count) noexcept {
  return guarded(instance, [&](Unit& unit) {
    Status worst = check_counts(unit, references.size(), count);
    for (std::size_t k = 0; worst < kError && k < count; ++k) {
      worst = check_reference(unit, references[k], TypeOf<Value>::kWord, TypeOf<Value>::kType);
      if (worst < kError) {
        worst = std::max(worst, unit.told(unit.bench->set(references[k], static_cast<double>(values[k]))));
      }
    }
    return worst;
  });
}

}  // namespace

// NOLINTBEGIN(readability-identifier-naming): the names are those of the standard
extern "C" {

#define FMI3 __attribute__((visibility("default")))

FMI3 const char* fmi3GetVersion() {
  return "3.0";
}

FMI3 Status fmi3SetDebugLogging(Instance instance, bool on, std::size_t, const String*) {
  return guarded(instance, [on](Unit& unit) {
    unit.logs_warnings = on;
    return kOk;
  });
}

FMI3 Instance fmi3InstantiateCoSimulation(String, String token, String resources, bool, bool logs, bool, bool,
                                          const Reference*, std::size_t, Environment environment,
                                          LogMessage log, IntermediateUpdate) {
  try {
    auto unit = std::make_unique<Unit>();
    unit->logs_warnings = logs;
    unit->log = [environment, log](Status status, const std::string& sentence) {
      if (log != nullptr) log(environment, status, category_of(status), sentence.c_str());
    };
    if (resources == nullptr) {
      unit->tell(kError, "the importer has given no resource path");
      return nullptr;
    }
    return open_bench(*unit, resources, token) ? unit.release() : nullptr;
  } catch (const std::exception&) {
    return nullptr;  // not even memory for a sentence
  }
}
FMI3 Instance fmi3InstantiateModelExchange(String, String, String, bool, bool, Environment environment,
                                           LogMessage log) {
  if (log != nullptr) log(environment, kError, "logStatusError", "this unit is for co-simulation only");
  return nullptr;
}
FMI3 Instance fmi3InstantiateScheduledExecution(String, String, String, bool, bool, Environment environment,
                                                LogMessage log, void*, void*, void*) {
  if (log != nullptr) log(environment, kError, "logStatusError", "this unit is for co-simulation only");
  return nullptr;
}
FMI3 void fmi3FreeInstance(Instance instance) {
  delete static_cast<Unit*>(instance);
}

FMI3 Status fmi3EnterInitializationMode(Instance instance, bool, double, double start_s, bool, double) {
  return guarded(instance, [start_s](Unit& unit) { return unit.told(unit.bench->start_at(start_s)); });
}
FMI3 Status fmi3ExitInitializationMode(Instance instance) {
  return guarded(instance, [](Unit&) { return kOk; });
}
FMI3 Status fmi3Terminate(Instance instance) {
  return guarded(instance, [](Unit&) { return kOk; });
}
FMI3 Status fmi3Reset(Instance instance) {
  return guarded(instance, [](Unit& unit) { return unit.told(unit.bench->reset()); });
}

// NOLINTBEGIN(bugprone-macro-parentheses): a type has no parentheses
#define FMI3_VARIABLES(Name, Value)                                                            \
  FMI3 Status fmi3Get##Name(Instance instance, const Reference* references, std::size_t count, \
                            Value* values, std::size_t value_count) {                          \
    return get_all(instance, {references, count}, values, value_count);                        \
  }                                                                                            \
  FMI3 Status fmi3Set##Name(Instance instance, const Reference* references, std::size_t count, \
                            const Value* values, std::size_t value_count) {                    \
    return set_all(instance, {references, count}, values, value_count);                        \
  }
FMI3_VARIABLES(Float64, double)
FMI3_VARIABLES(Int32, std::int32_t)
FMI3_VARIABLES(Int64, std::int64_t)
FMI3_VARIABLES(UInt64, std::uint64_t)
#undef FMI3_VARIABLES

#define FMI3_NO_VARIABLES(Name, Value)                                                                     \
  FMI3 Status fmi3Get##Name(Instance instance, const Reference*, std::size_t count, Value*, std::size_t) { \
    return none_of(instance, count, #Name);                                                                \
  }                                                                                                        \
  FMI3 Status fmi3Set##Name(Instance instance, const Reference*, std::size_t count, const Value*,          \
                            std::size_t) {                                                                 \
    return none_of(instance, count, #Name);                                                                \
  }
FMI3_NO_VARIABLES(Float32, float)
FMI3_NO_VARIABLES(Int8, std::int8_t)
FMI3_NO_VARIABLES(UInt8, std::uint8_t)
FMI3_NO_VARIABLES(Int16, std::int16_t)
FMI3_NO_VARIABLES(UInt16, std::uint16_t)
FMI3_NO_VARIABLES(UInt32, std::uint32_t)
FMI3_NO_VARIABLES(Boolean, bool)
FMI3_NO_VARIABLES(String, String)
#undef FMI3_NO_VARIABLES
// NOLINTEND(bugprone-macro-parentheses)

FMI3 Status fmi3GetBinary(Instance instance, const Reference*, std::size_t count, std::size_t*,
                          const std::uint8_t**, std::size_t) {
  return none_of(instance, count, "Binary");
}
FMI3 Status fmi3SetBinary(Instance instance, const Reference*, std::size_t count, const std::size_t*,
                          const std::uint8_t* const*, std::size_t) {
  return none_of(instance, count, "Binary");
}
FMI3 Status fmi3GetClock(Instance instance, const Reference*, std::size_t count, bool*) {
  return none_of(instance, count, "Clock");
}
FMI3 Status fmi3SetClock(Instance instance, const Reference*, std::size_t count, const bool*) {
  return none_of(instance, count, "Clock");
}

FMI3 Status fmi3GetFMUState(Instance instance, State* state) {
  return keep_state(instance, state);
}
FMI3 Status fmi3SetFMUState(Instance instance, State state) {
  return go_back(instance, state);
}
FMI3 Status fmi3FreeFMUState(Instance instance, State* state) {
  return free_state(instance, state);
}
FMI3 Status fmi3SerializedFMUStateSize(Instance instance, State state, std::size_t* size) {
  return state_size(instance, state, size);
}
FMI3 Status fmi3SerializeFMUState(Instance instance, State state, std::uint8_t* bytes, std::size_t size) {
  return write_state(instance, state, bytes, size);
}
FMI3 Status fmi3DeserializeFMUState(Instance instance, const std::uint8_t* bytes, std::size_t size,
                                    State* state) {
  return read_state(instance, bytes, size, state);
}

FMI3 Status fmi3DoStep(Instance instance, double from_s, double step_s, bool, bool* needs_event_handling,
                       bool* terminate, bool* returned_early, double* last_s) {
  return guarded(instance, [&](Unit& unit) {
    *needs_event_handling = *terminate = *returned_early = false;
    const Status status = unit.told(unit.bench->advance(from_s, step_s));
    *last_s = unit.bench->time_s();
    return status;
  });
}

// What this unit says that it cannot do: an importer may look for the names all the same.
#define FMI3_NOT_THERE(name, what)      \
  FMI3 Status name(Instance instance) { \
    return not_there(instance, what);   \
  }
FMI3_NOT_THERE(fmi3EnterEventMode, "event mode")
FMI3_NOT_THERE(fmi3EnterStepMode, "event mode")
FMI3_NOT_THERE(fmi3UpdateDiscreteStates, "event mode")
FMI3_NOT_THERE(fmi3EvaluateDiscreteStates, "event mode")
FMI3_NOT_THERE(fmi3EnterConfigurationMode, "structural parameters")
FMI3_NOT_THERE(fmi3ExitConfigurationMode, "structural parameters")
FMI3_NOT_THERE(fmi3GetNumberOfVariableDependencies, "variable dependencies")
FMI3_NOT_THERE(fmi3GetVariableDependencies, "variable dependencies")
FMI3_NOT_THERE(fmi3GetDirectionalDerivative, "directional derivatives")
FMI3_NOT_THERE(fmi3GetAdjointDerivative, "adjoint derivatives")
FMI3_NOT_THERE(fmi3GetOutputDerivatives, "derivatives of outputs")
FMI3_NOT_THERE(fmi3GetIntervalDecimal, "clocks")
FMI3_NOT_THERE(fmi3GetIntervalFraction, "clocks")
FMI3_NOT_THERE(fmi3GetShiftDecimal, "clocks")
FMI3_NOT_THERE(fmi3GetShiftFraction, "clocks")
FMI3_NOT_THERE(fmi3SetIntervalDecimal, "clocks")
FMI3_NOT_THERE(fmi3SetIntervalFraction, "clocks")
FMI3_NOT_THERE(fmi3SetShiftDecimal, "clocks")
FMI3_NOT_THERE(fmi3SetShiftFraction, "clocks")
FMI3_NOT_THERE(fmi3ActivateModelPartition, "clocks")
FMI3_NOT_THERE(fmi3EnterContinuousTimeMode, "model exchange")
FMI3_NOT_THERE(fmi3CompletedIntegratorStep, "model exchange")
FMI3_NOT_THERE(fmi3SetTime, "model exchange")
FMI3_NOT_THERE(fmi3SetContinuousStates, "model exchange")
FMI3_NOT_THERE(fmi3GetContinuousStateDerivatives, "model exchange")
FMI3_NOT_THERE(fmi3GetEventIndicators, "model exchange")
FMI3_NOT_THERE(fmi3GetContinuousStates, "model exchange")
FMI3_NOT_THERE(fmi3GetNominalsOfContinuousStates, "model exchange")
FMI3_NOT_THERE(fmi3GetNumberOfEventIndicators, "model exchange")
FMI3_NOT_THERE(fmi3GetNumberOfContinuousStates, "model exchange")
#undef FMI3_NOT_THERE

}  // extern "C"
// NOLINTEND(readability-identifier-naming)
