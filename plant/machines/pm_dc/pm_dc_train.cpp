#include "plant/machines/trains.hpp"
#include "plant/train/drive_train_impl.hpp"

namespace drivebench {

std::unique_ptr<Train> train_with(const PmDcMachineParameters& machine, bool two_masses) {
  return make_drive_train<PmDcMachine>(machine, two_masses);
}

}  // namespace drivebench
