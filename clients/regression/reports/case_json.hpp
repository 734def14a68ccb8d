#pragma once

#include <nlohmann/json.hpp>

#include "clients/regression/verdicts/result.hpp"

namespace drivebench::regression {

/// A result as reports and files have it; a number that is none is null.
nlohmann::ordered_json case_json(const CaseResult& result);

/// The result that the object tells, without its trace. Throws nlohmann::json::exception, or
/// std::invalid_argument for a word that is no verdict and a hash that is none.
CaseResult case_of(const nlohmann::ordered_json& object);

}  // namespace drivebench::regression
