#pragma once

#include <memory>

#include "plant/train/train.hpp"

/// One translation unit for each kind of machine, so that they compile beside each other.
namespace drivebench {

std::unique_ptr<Train> train_with(const InductionMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const SaturatedInductionMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const PmMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const BldcMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const WoundRotorMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const PmDcMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const SeparateDcMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const ShuntDcMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const SeriesDcMachineParameters& machine, bool two_masses);
std::unique_ptr<Train> train_with(const LinearDcMachineParameters& machine, bool two_masses);

}  // namespace drivebench
