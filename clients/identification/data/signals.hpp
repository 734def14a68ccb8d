#pragma once

#include "clients/identification/math/series.hpp"

namespace drivebench::identification {

/// (x_(k+1) - x_(k-1))/(2 T): the derivative at the sample itself. The ends take the parabola through the
/// last three samples.
Series central_difference(SeriesView x, double period_s);
/// (x_(k+1) - 2 x_k + x_(k-1))/T^2; the ends repeat their neighbours.
Series second_difference(SeriesView x, double period_s);
/// (x_k - x_(k-1))/T: the derivative half a period before the sample. The first repeats the second.
Series backward_difference(SeriesView x, double period_s);

/// The signal `samples` periods later, x(t + samples T), by the cubic through the four samples around that
/// instant; beyond its ends the record stays at its last value. A voltage that is the mean of the period
/// before its sample belongs half a period earlier: advanced(u, 0.5) puts it where the currents are; one that
/// was commanded and reaches the terminals 1.6 periods later: advanced(u, -1.6 - 0.5).
Series advanced(SeriesView x, double samples);

/// The value at a place between samples, by the same cubic; beyond its ends the record stays at its last
/// value. The series must not be empty.
double value_at(SeriesView x, double position) noexcept;

/// The largest absolute value.
double largest(SeriesView x) noexcept;

/// Whether the first sample has neither current nor speed: below 3 and 5 % of the largest ones. A filter sees
/// a start some samples early, and the first sample of a start may be one period late.
bool begins_at_rest(std::span<const SeriesView> currents, SeriesView speed) noexcept;

/// Two-phase quantities in some frame.
struct TwoPhaseSeries {
  Series a;
  Series b;
};

/// Power-invariant transform of three phases; the zero sequence drops out. Source: tag P3-02.
TwoPhaseSeries two_phase(SeriesView a, SeriesView b, SeriesView c);

/// Seen from a frame at these angles [rad, electrical]: d = cos a + sin b, q = -sin a + cos b. With n_p theta
/// this is dq of a PM motor and xy, the rotor's frame, of an induction motor.
TwoPhaseSeries rotated(const TwoPhaseSeries& x, SeriesView angle_rad);

/// Shaft angle [rad] from encoder counts. A floor encoder is half a count behind on average;
/// `half_count` takes that out.
Series angle_of(SeriesView counts, double counts_per_revolution, bool half_count);

}  // namespace drivebench::identification
