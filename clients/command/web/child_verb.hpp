#pragma once

#include "clients/web/gateway/runs/verb.hpp"

namespace drivebench::command {

/// Runs a verb in a process of this program with a group of its own, as web::RunVerb says.
web::VerbEnd run_child_verb(const web::Verb& verb, const web::SeeLine& see, const std::stop_token& stop);

}  // namespace drivebench::command
