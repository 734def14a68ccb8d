#pragma once

#include "clients/regression/suite/case.hpp"
#include "clients/regression/tables/key_table.hpp"

namespace drivebench::regression {

/// Reads the table [dut].
DeviceUnderTest read_device(KeyTable& table);

}  // namespace drivebench::regression
