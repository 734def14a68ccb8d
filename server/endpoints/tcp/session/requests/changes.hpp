#pragma once

#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/endpoints/tcp/session/requests/leases.hpp"

/// Requests that change an axis: the session checks each and sends it to the bench under its owner number.
namespace drivebench {

void write_parameter(Dialogue& dialogue, Leases& leases, const v1::WriteParameter& request);
void set_load(Dialogue& dialogue, Leases& leases, const v1::SetLoad& request);
void inject_fault(Dialogue& dialogue, Leases& leases, const v1::InjectFault& request);
void bump_shaft(Dialogue& dialogue, Leases& leases, const v1::ShaftBump& request);
void clear_faults(Dialogue& dialogue, Leases& leases, const v1::ClearFaults& request);

}  // namespace drivebench
