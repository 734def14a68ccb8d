#pragma once

#include <nlohmann/json.hpp>

#include "clients/regression/verdicts/result.hpp"

namespace drivebench::regression {

using Json = nlohmann::ordered_json;

/// A result as reports and files have it; a number that is none is null.
Json case_json(const CaseResult& result);

/// The result that the object tells, without its trace. Throws nlohmann::json::exception, or
/// std::invalid_argument for a word that is no verdict and a hash that is none.
CaseResult case_of(const Json& object);

}  // namespace drivebench::regression
