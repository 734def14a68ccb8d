#pragma once

#include <vector>

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// What the user or the bench has settled.
struct GivenWiring {
  bool pole_pairs = false;
  bool direction = false;
  bool voltage_shift = false;
  bool zero = false;
  bool by_bench = false;  ///< the bench has settled it: what would need refinements is not looked for again
};

/// Finds pole pairs, the direction of the encoder against the order of the phases, the shift between voltages
/// and currents and, for a magnet, the encoder's zero. The flux equations (flux_equations.hpp) of every
/// hypothesis propose; where more than one remains, the likelihood of the refined motors' innovations
/// decides. What stays open is said in the fact and left as it is in `settings`; what was found there and is
/// not given is set.
///
/// Data cannot tell a reversed encoder from two crossed phases, nor pole pairs without the counts of a turn:
/// `direction` and `pole_pairs` are those of this pair and these counts.
std::vector<WiringFact> find_wiring(const MeasuredData& data, Settings& settings, const GivenWiring& given);

}  // namespace drivebench::identification
