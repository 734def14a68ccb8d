#pragma once

namespace drivebench {

/// e^x with the same bits on every machine: see plant/math/trig.hpp. Error below 1 ulp where the result is a
/// normal number, measured by tests/plant/exponential_test.cpp. Too large gives infinity, too small zero, NaN
/// itself.
double exponential(double x) noexcept;

/// e^x - 1 without what the difference cancels next to zero; -0 stays -0. Error below 1.9 ulp.
double exponential_less_one(double x) noexcept;

/// base^exponent for base >= 0, as exponential(exponent·logarithm(base)): the error is 1 ulp and another 1.6
/// for each unit of |exponent·log(base)|. A base below 0 and NaN give NaN, the exponent 0 gives 1.
double power(double base, double exponent) noexcept;

}  // namespace drivebench
