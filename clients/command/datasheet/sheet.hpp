#pragma once

#include <array>
#include <functional>
#include <map>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// From the numbers of a data sheet to a motor or bench file: each quantity has the forms in which data
/// sheets print it, and every form says how it becomes the value of the file.
namespace drivebench::command {

/// What is known of a motor or bench so far.
struct Sheet {
  using Numbers = std::map<std::string, double, std::less<>>;

  Numbers given{};     ///< as the user gave them, by the name of the form
  Numbers made{};      ///< as the file has them, by key
  bool delta = false;  ///< phase numbers are those of the phases of a delta

  bool has(std::string_view form) const { return given.contains(form); }
  /// The number of a form, or another one where the user gave none.
  double at(std::string_view form, double otherwise = 0.0) const {
    const auto found = given.find(form);
    return found == given.end() ? otherwise : found->second;
  }
  double value(std::string_view key) const {
    const auto found = made.find(key);
    return found == made.end() ? 0.0 : found->second;
  }
};

/// One of the forms in which data sheets print a quantity; its name is that of the option.
struct Form {
  std::string_view name;
  std::string_view unit;
  std::string_view meaning;
  double least;
  double most;
  double (*made)(double x, const Sheet& sheet);
  /// The same for people: {x} is the number, {p} the pole pairs, {k} the torque constant, {r} the resistance
  /// of the stator, {f} the frequency of the line, {i} the current without load; {third} and {root3} divide
  /// where the phases are those of a delta.
  std::string_view formula = "{x}";
  std::string_view why = "";
  bool only_alone = false;  ///< counts only where no other form is given, and is not compared
};

struct Quantity {
  std::string_view key;  ///< in the file; empty: only other values come of it, or checks
  std::string_view title;
  bool required;
  std::span<const Form> forms;
};

/// A value of the file and the comment that stands above it.
struct FileLine {
  std::vector<std::string> comment;
  std::string key;
  std::string value;
};

/// The value of a quantity from the form that stands first, with its derivation; the sheet keeps it. Throws
/// UsageError if the forms that the user gave contradict each other.
FileLine line_of(const Quantity& quantity, Sheet& sheet);

/// Whether the user gave one of its forms.
bool is_given(const Quantity& quantity, const Sheet& sheet);

/// Two numbers for one thing may differ by this, as rounded and measured numbers do.
inline constexpr double kAgree = 0.10;
bool agree(double a, double b);
/// "; that is nearly sqrt(2), ..." for a ratio that a common mistake makes; else empty.
std::string likely_mistake(double ratio);

/// "--kt-rms 0.05".
std::string option_of(const Form& form, double x);
/// A real number for TOML, which has a point or an exponent.
std::string real(double value);
/// A text for TOML, in quotes.
std::string in_quotes(std::string_view text);

// ---- what the data sheets of all motors share ----

inline constexpr double kRadPerRpm = std::numbers::pi / 30.0;
/// The largest number of most forms.
inline constexpr double kMostGiven = 1e6;

inline double as_it_is(double x, const Sheet&) {
  return x;
}

inline constexpr auto kInertiaForms = std::to_array<Form>({
    {"inertia-kgm2", "kg*m^2", "of rotor and shaft", 1e-12, 1e9, as_it_is},
    {"inertia-gcm2", "g*cm^2", "the same", 1e-5, 1e12, [](double x, const Sheet&) { return 1e-7 * x; },
     "{x} * 1e-7", "1 g*cm^2 is 1e-3 kg * 1e-4 m^2."},
    {"inertia-kgcm2", "kg*cm^2", "the same", 1e-8, 1e12, [](double x, const Sheet&) { return 1e-4 * x; },
     "{x} * 1e-4", "1 kg*cm^2 is 1e-4 kg*m^2."},
});
inline constexpr Quantity kInertia = {"inertia_kgm2", "inertia J", true, kInertiaForms};

inline constexpr auto kPolePairForms = std::to_array<Form>({
    {"pole-pairs", "pairs", "electrical turns for one turn of the shaft", 1, 1000, as_it_is},
    {"poles", "poles", "north and south poles together", 2, 2000,
     [](double x, const Sheet&) { return x / 2.0; }, "{x} / 2", "A pair is a north pole and a south pole."},
});
inline constexpr Quantity kPolePairs = {"pole_pairs", "pole pairs n_p", true, kPolePairForms};

/// Reads the missing quantities from a terminal; elsewhere throws UsageError with all of them.
void complete(std::span<const Quantity> missing, Sheet& sheet);

}  // namespace drivebench::command
