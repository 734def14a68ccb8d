#pragma once

#include <string>
#include <vector>

#include "protocols/fmi/fmu_variables.hpp"

/// Functional Mock-up Units (FMI): a bench that other simulators run.
namespace drivebench::fmu {

/// The versions of the standard.
enum class Fmi { k2, k3 };

/// modelDescription.xml of a bench for co-simulation.
std::string model_description(const drivebench_description& bench,
                              const std::vector<fmi::Variable>& variables, Fmi version);

}  // namespace drivebench::fmu
