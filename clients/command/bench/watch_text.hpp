#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {

/// A value as number_text() writes it. A magnitude far below the usual range of the signal shows as 0.
std::string shown_value(const Signal& signal, const Sample& sample);

/// The same with its unit and a prefix: `-1.2346 mA`. Without UTF-8 a millionth is `u`.
std::string value_with_unit(const Signal& signal, const Sample& sample, bool utf8);

/// Whether a curve of the signal says something: not of words, bits and the tick.
bool has_curve(const Signal& signal) noexcept;

/// The newest `width` values as columns of eight heights from the least to the greatest of them; empty for
/// fewer than two values. One that is infinite or no number is a blank.
std::string sparkline(std::span<const double> values, std::size_t width, bool utf8);

/// Whether the locale of the environment speaks UTF-8.
bool speaks_utf8();

}  // namespace drivebench::command
