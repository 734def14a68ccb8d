#include "tests/adversity/simulator/account/io_pauses.hpp"

namespace drivebench::simulator {
namespace {

/// The I/O runs more often, and looks at its clock as often.
constexpr Time kStep = 10 * kMillisecond;

}  // namespace

void IoPauses::ran(Time now) {
  if (now - last_run_ > kStep) pauses_.push_back({.begin = last_run_, .end = now});
  last_run_ = now;
}

Time IoPauses::end_of(Time begin, Time limit) const {
  Time end = begin + limit;
  for (const Pause& pause : pauses_) {
    if (pause.begin <= begin && begin < pause.end) end = pause.end + limit;
    if (pause.begin < end + kStep && end < pause.end) end = pause.end + (pause.end - end);
  }
  return end;
}

}  // namespace drivebench::simulator
