#include "clients/command/motor/steady_state_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "clients/command/recording/svg_plot.hpp"
#include "protocols/markup.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

constexpr int kPoints = 1000;
constexpr double kBackward = 1.5;  // slip at the left end
constexpr double kSize_px = 600.0;
constexpr double kMargin_px = 70.0;
constexpr double kRow_px = 13.0;    // from one text to the next below it
constexpr double kLetter_px = 6.0;  // no letter of a text is wider on average

/// A text beside its point in the picture.
struct Label {
  double point_x;
  double point_y;
  double x;
  double y;
  std::string text;

  bool covers(const Label& other) const {
    const double width_px = kLetter_px * static_cast<double>(text.size());
    const double other_px = kLetter_px * static_cast<double>(other.text.size());
    return std::abs(y - other.y) < kRow_px && x < other.x + other_px && other.x < x + width_px;
  }
};

/// Moves texts that would cover others away from the height `middle_px`, and all into the picture.
void move_apart(std::vector<Label>& labels, double middle_px) {
  for (Label& each : labels) {
    each.x = std::min(each.x, kSize_px - 4.0 - kLetter_px * static_cast<double>(each.text.size()));
    const double step_px = each.point_y < middle_px ? -1.0 : 1.0;
    while (std::any_of(labels.data(), &each, [&](const Label& other) { return each.covers(other); }))
      each.y += step_px;
  }
}

}  // namespace

std::string steady_state_plot(const InductionCircuit& circuit, const std::string& title) {
  const double last = circuit.largest_power_slip(InductionCircuit::Mode::kGenerator);
  std::vector<InductionCircuit::Point> points;
  for (int k = 0; k <= kPoints; ++k)
    points.push_back(circuit.at(kBackward + (last - kBackward) * k / kPoints));
  using Point = InductionCircuit::Point;
  const auto column = [&](const std::function<double(const Point&)>& value) {
    std::vector<double> values(points.size());
    std::ranges::transform(points, values.begin(), value);
    return values;
  };
  const std::vector<Panel> panels = {
      {.label = "torque [N*m]", .lines = {{"torque", column(&Point::torque_nm)}}},
      {.label = "current rms [A]",
       .lines = {{"stator", column([](const Point& p) { return std::abs(p.stator_a); })},
                 {"rotor", column([](const Point& p) { return std::abs(p.rotor_a); })}}},
      {.label = "power [W]",
       .lines = {{"line", column(&Point::active_w)},
                 {"shaft", column(&Point::mechanical_w)},
                 {"R_S", column(&Point::stator_loss_w)},
                 {"R_R", column(&Point::rotor_loss_w)}}},
      {.label = "cos phi, efficiency",
       .lines = {{"cos phi", column(&Point::power_factor)}, {"efficiency", column(&Point::efficiency)}}}};
  return svg_of(title, "speed [rad/s]", column(&Point::speed_rad_s), panels);
}

std::string circle_diagram(const InductionCircuit& circuit, const std::vector<NamedPoint>& points,
                           const std::string& title) {
  const InductionCircuit::Circle circle = circuit.circle();
  // Reactive current to the right, active current upwards, the origin at the left.
  const double pixels_per_a = (kSize_px - 2.0 * kMargin_px) /
                              std::max(-circle.centre_a.imag() + circle.radius_a, 2.0 * circle.radius_a);
  const double middle_px = 0.5 * kSize_px + circle.centre_a.real() * pixels_per_a;
  const auto x_px = [&](std::complex<double> i) { return kMargin_px - i.imag() * pixels_per_a; };
  const auto y_px = [&](std::complex<double> i) { return middle_px - i.real() * pixels_per_a; };
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{0}' viewBox='0 0 {0} {0}' "
      "font-family='sans-serif' font-size='10'>\n<rect width='100%' height='100%' fill='#fff'/>\n"
      "<text x='{1}' y='18' font-size='13'>{2}</text>\n"
      "<path d='M{1} 30V{0}M0 {3:.1f}H{0}' stroke='#999'/>\n"
      "<text x='{1}' y='40'> active current</text>\n"
      "<text x='{0}' y='{4:.1f}' text-anchor='end'>reactive current</text>\n"
      "<circle cx='{5:.1f}' cy='{6:.1f}' r='{7:.1f}' fill='none' stroke='#0072b2'/>\n",
      kSize_px, kMargin_px, markup(title), middle_px, middle_px - 4.0, x_px(circle.centre_a),
      y_px(circle.centre_a), circle.radius_a * pixels_per_a);
  std::vector<Label> labels;
  for (const auto& [name, point] : points) {
    const double x = x_px(point.stator_a);
    const double y = y_px(point.stator_a);
    labels.push_back({.point_x = x,
                      .point_y = y,
                      .x = x + 8.0,
                      .y = y - 4.0,
                      .text = fmt::format("{}: {} A", name, number_text(std::abs(point.stator_a)))});
  }
  move_apart(labels, middle_px);
  const auto out = std::back_inserter(svg);
  for (const Label& each : labels) {
    fmt::format_to(out,
                   "<path d='M{0:.1f} {1:.1f}L{2:.1f} {3:.1f}' stroke='#999'/>\n"
                   "<circle cx='{0:.1f}' cy='{1:.1f}' r='3' fill='#d55e00'/>\n"
                   "<text x='{2:.1f}' y='{4:.1f}'>{5}</text>\n",
                   each.point_x, each.point_y, each.x, each.y - 3.0, each.y, each.text);
  }
  return svg + "</svg>\n";
}

}  // namespace drivebench::command
