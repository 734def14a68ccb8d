#include "plant/machines/trains.hpp"

#include <variant>

namespace drivebench {

std::unique_ptr<Train> make_train(const MachineParameters& machine, bool two_masses) {
  return std::visit([two_masses](const auto& p) { return train_with(p, two_masses); }, machine);
}

}  // namespace drivebench
