#include "clients/regression/formulas/formula.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

constexpr std::size_t kLongest = 500;  ///< [bytes]
constexpr int kDeepestBrackets = 100;
constexpr int kHighestExponent = 9;

bool is_digit(char c) noexcept {
  return c >= '0' && c <= '9';
}

bool is_name(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || is_digit(c) || c == '_';
}

/// Far more than any quantity has, and far less than an integer holds.
bool is_absurd(const Dimension& dimension) noexcept {
  return std::ranges::any_of(dimension.exponents, [](int each) { return std::abs(each) > 1000; });
}

/// Infinite or no number where the divisor is zero (IEEE 754), which a check then tells.
__attribute__((no_sanitize("float-divide-by-zero"))) double quotient_of(double dividend,
                                                                        double divisor) noexcept {
  return dividend / divisor;
}

double power_of(double base, int exponent) noexcept {
  double product = 1.0;
  for (int i = 0; i < std::abs(exponent); ++i)
    product *= base;
  return exponent < 0 ? quotient_of(1.0, product) : product;
}

/// What is no number stays none, so that a check of it fails.
double sign_of(double value) noexcept {
  if (value > 0.0) return 1.0;
  if (value < 0.0) return -1.0;
  return std::isnan(value) ? value : 0.0;
}

}  // namespace

/// Recursive descent. The first mistake ends it: after that every part is without dimension.
class FormulaParser {
 public:
  explicit FormulaParser(std::string_view text) : rest_(text), formula_(new Formula) {
    formula_->text_ = text;
  }

  std::variant<std::shared_ptr<const Formula>, std::string> parsed() {
    if (rest_.size() > kLongest) return fmt::format("has more than {} bytes", kLongest);
    const Dimension dimension = sum();
    if (why_not_.empty() && !rest_.empty()) fail(fmt::format("has \"{}\" after its end", printable(rest_)));
    if (!why_not_.empty()) return why_not_;
    formula_->dimension_ = dimension;
    formula_->unit_ = unit_of(dimension);
    formula_->label_.name = formula_->text_;
    formula_->label_.unit = formula_->unit_;
    return std::shared_ptr<const Formula>(std::move(formula_));
  }

 private:
  using Code = Formula::Code;

  Dimension fail(std::string why) {
    if (why_not_.empty()) why_not_ = std::move(why);
    rest_ = {};
    return {};
  }

  char next() {
    while (rest_.starts_with(' '))
      rest_.remove_prefix(1);
    return rest_.empty() ? '\0' : rest_.front();
  }
  bool take(char c) {
    if (next() != c) return false;
    rest_.remove_prefix(1);
    return true;
  }
  std::string_view name() {
    next();
    const auto end = std::ranges::find_if_not(rest_, is_name);
    const std::string_view found = rest_.substr(0, static_cast<std::size_t>(end - rest_.begin()));
    rest_.remove_prefix(found.size());
    return found;
  }

  /// `uses` values of the stack become one.
  void emit(Formula::Step step, std::size_t uses) {
    depth_ = depth_ + 1 - uses;
    if (depth_ > Formula::kDeepest) fail(fmt::format("keeps more than {} values waiting", Formula::kDeepest));
    formula_->steps_.push_back(step);
  }

  Dimension same(const Dimension& a, const Dimension& b, std::string_view verb) {
    if (a == b) return a;
    return fail(fmt::format("{} {} and {}: write a number with its unit as 2 [{}]", verb, unit_of(a),
                            unit_of(b), unit_of(a)));
  }

  Dimension sum() {
    Dimension left = product();
    for (;;) {
      const bool is_plus = take('+');
      if (!is_plus && !take('-')) return left;
      left = same(left, product(), is_plus ? "adds" : "subtracts");
      emit({.code = is_plus ? Code::kAdd : Code::kSubtract}, 2);
    }
  }

  Dimension product() {
    Dimension left = sign();
    for (;;) {
      const bool is_times = take('*');
      if (!is_times && !take('/')) return left;
      const Dimension right = sign();
      left = is_times ? left * right : left / right;
      if (is_absurd(left)) return fail("has a unit beyond all quantities");
      emit({.code = is_times ? Code::kMultiply : Code::kDivide}, 2);
    }
  }

  Dimension sign() {
    if (!take('-')) return power();
    const Dimension inner = nested([this] { return sign(); });
    emit({.code = Code::kNegate}, 1);
    return inner;
  }

  Dimension power() {
    const Dimension base = atom();
    if (!take('^')) return base;
    next();
    int exponent = 0;
    const auto [stop, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), exponent);
    if (error != std::errc{} || std::abs(exponent) > kHighestExponent)
      return fail(fmt::format("has no whole exponent from -{0} to {0} after ^", kHighestExponent));
    rest_.remove_prefix(static_cast<std::size_t>(stop - rest_.data()));
    emit({.code = Code::kPower, .number = static_cast<double>(exponent)}, 1);
    const Dimension result = base.power(exponent);
    return is_absurd(result) ? fail("has a unit beyond all quantities") : result;
  }

  template <class Inner>
  Dimension nested(Inner inner) {
    if (++brackets_ > kDeepestBrackets) return fail("has too many brackets in each other");
    const Dimension found = inner();
    --brackets_;
    return found;
  }

  Dimension in_brackets() {
    const Dimension found = nested([this] { return sum(); });
    if (!take(')')) return fail("lacks a )");
    return found;
  }

  Dimension atom() {
    if (take('(')) return in_brackets();
    const char c = next();
    if (is_digit(c) || c == '.') return number();
    const std::string_view word = name();
    if (word.empty()) {
      if (!why_not_.empty()) return {};
      return fail(rest_.empty()
                      ? "ends too early"
                      : fmt::format("has \"{}\" where a signal, a number or a ( belongs", printable(rest_)));
    }
    if (take('(')) return call(word);
    return signal(word);
  }

  Dimension number() {
    double value = 0.0;
    const auto [stop, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc{}) return fail("has a number that is none");
    rest_.remove_prefix(static_cast<std::size_t>(stop - rest_.data()));
    emit({.code = Code::kNumber, .number = value}, 0);
    if (!take('[')) return {};
    const std::size_t end = rest_.find(']');
    if (end == std::string_view::npos) return fail("lacks a ]");
    const std::string_view unit = rest_.substr(0, end);
    const std::optional<Dimension> dimension = dimension_of(unit);
    if (!dimension)
      return fail(fmt::format("has \"{}\", no unit of a signal or product of some", printable(unit)));
    rest_.remove_prefix(end + 1);
    return *dimension;
  }

  Dimension signal(std::string_view word) {
    Formula::Step step{.code = Code::kSignal};
    std::string_view axis;
    // An axis may have '-' in its name, so the text up to the point is looked at again.
    if (const std::size_t point = axis_end(word); point != std::string_view::npos) {
      axis = std::string_view(word.data(), point);
      rest_.remove_prefix(point + 1 - word.size());
      word = name();
    }
    step.signal = find_signal(word);
    if (step.signal == nullptr) {
      return fail(fmt::format("\"{}\" is no signal of a bench{}", printable(word),
                              did_you_mean(word, kSignals, &Signal::name)));
    }
    if (!axis.empty()) step.other_axis = place_of(axis);
    emit(step, 0);
    return dimension_of(step.signal->unit).value_or(Dimension{});
  }

  /// The length of an axis' name that begins with this word and ends with a point; npos: it is none.
  std::size_t axis_end(std::string_view word) const {
    const char* const end = rest_.data() + rest_.size();
    const char* at = word.data() + word.size();
    while (at != end && (is_name(*at) || *at == '-'))
      ++at;
    return end - at > 1 && *at == '.' && is_name(at[1]) && !is_digit(at[1])
               ? static_cast<std::size_t>(at - word.data())
               : std::string_view::npos;
  }

  int place_of(std::string_view axis) {
    std::vector<std::string>& axes = formula_->axes_;
    const auto found = std::ranges::find(axes, axis);
    const auto place = static_cast<int>(found - axes.begin());
    if (found == axes.end()) axes.emplace_back(axis);
    return place;
  }

  Dimension call(std::string_view word) {
    struct Function {
      std::string_view name;
      Code code;
      bool takes_two;
    };
    static constexpr auto kFunctions = std::to_array<Function>({{"abs", Code::kAbs, false},
                                                                {"sqrt", Code::kSqrt, false},
                                                                {"sign", Code::kSign, false},
                                                                {"min", Code::kMin, true},
                                                                {"max", Code::kMax, true}});
    const auto found = std::ranges::find(kFunctions, word, &Function::name);
    if (found == kFunctions.end())
      return fail(
          fmt::format("\"{}\" is no function: there are abs, sqrt, sign, min and max", printable(word)));
    Dimension result = nested([this] { return sum(); });
    if (found->takes_two) {
      if (!take(',')) return fail(fmt::format("lacks the second value of {}", word));
      result = same(result, nested([this] { return sum(); }), "compares");
    }
    if (!take(')')) return fail("lacks a )");
    emit({.code = found->code}, found->takes_two ? 2 : 1);
    if (found->code == Code::kSign) return {};
    if (found->code != Code::kSqrt) return result;
    const std::optional<Dimension> root = result.root();
    return root ? *root : fail(fmt::format("takes the root of {}", unit_of(result)));
  }

  std::string_view rest_;
  std::unique_ptr<Formula> formula_;
  std::string why_not_;
  std::size_t depth_ = 0;
  int brackets_ = 0;
};

std::variant<std::shared_ptr<const Formula>, std::string> Formula::parse(std::string_view text) {
  return FormulaParser(text).parsed();
}

double Formula::value(std::span<const Sample> samples, std::size_t axis,
                      std::span<const std::size_t> places) const noexcept {
  std::array<double, kDeepest> stack;  // what is read was written before
  std::size_t top = 0;
  for (const Step& step : steps_) {
    switch (step.code) {
      case Code::kNumber:
        stack[top++] = step.number;
        continue;
      case Code::kSignal: {
        const std::size_t place =
            step.other_axis < 0 ? axis : places[static_cast<std::size_t>(step.other_axis)];
        stack[top++] = value_of(*step.signal, samples[place]);
        continue;
      }
      case Code::kPower:
        stack[top - 1] = power_of(stack[top - 1], static_cast<int>(step.number));
        continue;
      case Code::kNegate:
        stack[top - 1] = -stack[top - 1];
        continue;
      case Code::kAbs:
        stack[top - 1] = std::abs(stack[top - 1]);
        continue;
      case Code::kSqrt:
        stack[top - 1] = std::sqrt(stack[top - 1]);
        continue;
      case Code::kSign:
        stack[top - 1] = sign_of(stack[top - 1]);
        continue;
      default:
        break;
    }
    const double right = stack[--top];
    double& left = stack[top - 1];
    if (step.code == Code::kAdd) left += right;
    if (step.code == Code::kSubtract) left -= right;
    if (step.code == Code::kMultiply) left *= right;
    if (step.code == Code::kDivide) left = quotient_of(left, right);
    if (step.code == Code::kMin) left = std::isnan(right) ? right : std::min(left, right);
    if (step.code == Code::kMax) left = std::isnan(right) ? right : std::max(left, right);
  }
  return stack[0];
}

}  // namespace drivebench::regression
