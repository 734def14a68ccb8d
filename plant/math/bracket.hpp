#pragma once

namespace drivebench {

/// The search for a zero between two points whose values have different signs: ask guess() for a point, tell
/// narrow() the value there. The guess lies on the inverse parabola through the last three points where that
/// is sure to be between the ends (Chandrupatla's condition), else on a chord, by the Illinois method.
struct Bracket {
  double low = 0.0;
  double low_value;
  double high = 1.0;
  double high_value;
  int side = 0;         ///< -1: the last point is `high`, 1: it is `low`; 0: there is none
  double weight = 1.0;  ///< of the other end in a chord: half as much each time that it stays
  double past = 0.0;    ///< the end whose place the last point has taken
  double past_value = 0.0;

  double guess() const noexcept {
    double part;
    if (side != 0 && along_parabola(part)) return last() + part * width();
    const double from = low_value * (side < 0 ? weight : 1.0);
    const double to = high_value * (side > 0 ? weight : 1.0);
    return low + (high - low) * (from / (from - to));
  }

  void narrow(double at, double value) noexcept {
    const int moved = low_value * value < 0.0 ? -1 : 1;
    weight = side == moved ? 0.5 * weight : 1.0;
    side = moved;
    double& end = moved < 0 ? high : low;
    double& end_value = moved < 0 ? high_value : low_value;
    past = end;
    past_value = end_value;
    end = at;
    end_value = value;
  }

 private:
  double last() const noexcept { return side < 0 ? high : low; }
  /// From the last point to the other end.
  double width() const noexcept { return side < 0 ? low - high : high - low; }

  /// The part of this way; false: the parabola may leave it.
  bool along_parabola(double& part) const noexcept {
    const double a = side < 0 ? high_value : low_value;
    const double b = side < 0 ? low_value : high_value;
    const double to_past = past - last();
    if (past_value == a || past_value == b || to_past == width()) return false;
    const double place = width() / (width() - to_past);
    const double level = (a - b) / (past_value - b);
    if (!(level * level < place && (1.0 - level) * (1.0 - level) < 1.0 - place)) return false;
    part = a / (b - a) * (past_value / (b - past_value)) +
           to_past / width() * (a / (past_value - a)) * (b / (past_value - b));
    return true;
  }
};

}  // namespace drivebench
