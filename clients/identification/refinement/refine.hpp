#pragma once

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// Refines the estimates of the equations by the predicted trajectory (predictor.hpp): Gauss-Newton on the
/// innovations over all parameters, friction and load, with the noises of voltages and currents by maximum
/// likelihood; the encoder's is that of its counts. Each estimate gets its 95 % interval: 1.96 standard
/// deviations from the information of the innovations or, if that is more, from the scatter of their scores,
/// which does not take the innovations for white. The book's value and its index stay beside it.
///
/// A window of more than Settings::most_samples samples is cut after these, and a note says so.
///
/// The verdict of the equations is replaced: a parameter whose interval is wider than half of its value is
/// unseen (a friction also stands where it hardly matters beside the torque that accelerates), and a motor
/// that does not explain the record within what noise and quantisation allow has no parameter that is seen.
/// The verdict then says which experiment would help.
///
/// `near`, if there is one, is a refined motor that explains the record and hardly differs: its values and
/// noises begin the last round of the search, and the others fall away.
void refine(const MeasuredData& data, const Settings& settings, Result& result, const Result* near = nullptr);

}  // namespace drivebench::identification
