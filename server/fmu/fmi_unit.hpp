#pragma once

#include <cstddef>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/fmu/fmu_instance.hpp"

/// What the functions of FMI 2 and FMI 3 share.
namespace drivebench::fmi {

/// The results of both versions, with their numbers.
enum Status { kOk, kWarning, kDiscard, kError, kFatal };

/// The category of the log that a sentence belongs to.
inline const char* category_of(Status status) noexcept {
  return status == kWarning ? "logStatusWarning" : "logStatusError";
}

/// An instance that an importer has made. An exception becomes a status before C sees it.
struct Unit {
  std::function<void(Status, const std::string& sentence)> log;
  bool logs_warnings = false;
  std::unique_ptr<FmuInstance> bench;

  Status tell(Status status, const std::string& sentence) const {
    if (log && (logs_warnings || status >= kError)) log(status, sentence);
    return status;
  }
  /// The status for a drivebench_code of the bench, whose sentence it tells.
  Status told(int code) const;
};

/// The state of a unit, as the importer keeps it.
using Saved = std::vector<std::byte>;

/// Opens the bench of the unit, which must be that of the token; false after it has told why not.
bool open_bench(Unit& unit, const std::filesystem::path& resources, const char* token);

/// Runs a request of the importer.
template <class Request>
Status guarded(void* instance, Request request) noexcept {
  if (instance == nullptr) return kError;
  const Unit& unit = *static_cast<Unit*>(instance);
  try {
    return request(*static_cast<Unit*>(instance));
  } catch (const std::exception& failure) {
    return unit.tell(kFatal, failure.what());
  }
}

/// Checks that there is a variable with this number and one of the types; `word` names them for the sentence.
template <class... Types>
Status check_reference(const Unit& unit, unsigned reference, const char* word, Types... types) {
  const auto& variables = unit.bench->variables();
  if (reference < variables.size() && (... || (variables[reference].type == types))) return kOk;
  return unit.tell(kError, "there is no variable of type " + std::string(word) +
                               " with the value reference " + std::to_string(reference));
}

/// A request for variables of a type that this unit does not have.
Status none_of(void* instance, std::size_t count, const char* type) noexcept;

/// What this unit does not have.
Status not_there(void* instance, const char* what) noexcept;

// ---- states ----

Status keep_state(void* instance, void** state) noexcept;
Status go_back(void* instance, void* state) noexcept;
Status free_state(void* instance, void** state) noexcept;
Status state_size(void* instance, void* state, std::size_t* size) noexcept;
Status write_state(void* instance, void* state, void* bytes, std::size_t size) noexcept;
Status read_state(void* instance, const void* bytes, std::size_t size, void** state) noexcept;

}  // namespace drivebench::fmi
