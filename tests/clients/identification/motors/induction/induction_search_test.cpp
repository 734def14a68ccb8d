#include "clients/identification/motors/induction/induction_search.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>

#include "clients/identification/motors/induction/induction_polynomial.hpp"
#include "clients/identification/motors/induction/induction_regressor.hpp"

namespace drivebench::identification::induction_search_test {
namespace {

/// Data of a motor whose signals need not obey its equations: rows around a known K, with an error.
Triangle some_data(double noise, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> random;
  const double k4 = 1717.0;
  const double k6 = 3840.0;
  const double k8 = 0.0779;
  const double k14 = 218.8;
  Regression fit(induction_parameter_names());
  for (int k = 0; k < 100; ++k) {
    std::array<double, kInductionParameters> row{};
    double y = 0.0;
    double size = 0.0;
    for (std::size_t j = 0; j < row.size(); ++j) {
      const auto [factor, power] = kInductionMonomials[j];
      const double of = factor == InductionFactor::kK4    ? k4
                        : factor == InductionFactor::kK6  ? k6
                        : factor == InductionFactor::kK14 ? k14
                                                          : 1.0;
      const double value = of * std::pow(k8, power);
      row[j] = random(engine) / value;
      y += row[j] * value;
      size += 1.0;
    }
    fit.add(row, y + noise * std::sqrt(size) * random(engine));
  }
  return fit.factor();
}

// Every minimum is one: no point around it has a smaller error, and its Hessian is that of the error (1e-4,
// second differences). Catches: a maximum taken for a minimum, a projection onto the wrong columns, a mixed
// term of the Hessian without E.
TEST(InductionSearch, MinimaAreMinimaAndHessiansAreSecondDerivatives) {
  for (const double noise : {0.01, 0.5}) {
    const Triangle factor = some_data(noise, 11);
    const InductionSearch search = search_induction(factor);
    ASSERT_TRUE(search.complete);
    ASSERT_FALSE(search.minima.empty());
    EXPECT_EQ(search.degree, 42);
    EXPECT_EQ(search.stationary_points, 2 * static_cast<int>(search.minima.size()) - 1);
    for (const InductionMinimum& m : search.minima) {
      const double at[] = {m.k4, m.k6, m.k8, m.k14};
      const auto error = [&](std::size_t a, double da, std::size_t b, double db) {
        double x[] = {at[0], at[1], at[2], at[3]};
        x[a] += da;
        x[b] += db;
        return induction_error(factor, x[0], x[1], x[2], x[3]);
      };
      for (std::size_t a = 0; a < 4; ++a) {
        const double da = 1e-3 * std::abs(at[a]);
        EXPECT_GT(error(a, da, a, 0.0), m.residual);
        EXPECT_GT(error(a, -da, a, 0.0), m.residual);
        for (std::size_t b = 0; b < 4; ++b) {
          const double db = 1e-3 * std::abs(at[b]);
          const double second =
              (error(a, da, b, db) - error(a, da, b, -db) - error(a, -da, b, db) + error(a, -da, b, -db)) /
              (4.0 * da * db);
          const double scale = std::sqrt(m.hessian[a][a] * m.hessian[b][b]);
          EXPECT_NEAR(m.hessian[a][b], second, 1e-4 * scale) << a << b;
        }
      }
    }
  }
}

/// Residues of a prime: exact arithmetic of one word, in which an identity of whole numbers can be tested.
class Residue {
 public:
  static constexpr std::uint64_t kPrime = (std::uint64_t{1} << 61) - 1;
  Residue() = default;
  Residue(int x) : x_(x >= 0 ? static_cast<std::uint64_t>(x) : kPrime - static_cast<std::uint64_t>(-x)) {}
  explicit Residue(const Whole& x) : x_(static_cast<std::uint64_t>(((x % kPrime) + kPrime) % kPrime)) {}
  friend bool operator==(Residue a, Residue b) { return a.x_ == b.x_; }
  friend Residue operator+(Residue a, Residue b) { return raw((a.x_ + b.x_) % kPrime); }
  friend Residue operator-(Residue a, Residue b) { return raw((a.x_ + kPrime - b.x_) % kPrime); }
  friend Residue operator*(Residue a, Residue b) {
    __extension__ using Wide = unsigned __int128;
    return raw(static_cast<std::uint64_t>(Wide{a.x_} * b.x_ % kPrime));
  }
  Residue inverse() const {
    Residue result = 1;
    Residue power = *this;
    for (std::uint64_t e = kPrime - 2; e != 0; e >>= 1) {
      if ((e & 1) != 0) result = result * power;
      power = power * power;
    }
    return result;
  }

 private:
  static Residue raw(std::uint64_t x) {
    Residue r;
    r.x_ = x;
    return r;
  }
  std::uint64_t x_ = 0;
};

using InK14 = Polynomial<Residue>;
using InK6 = Polynomial<InK14>;
using InK4 = Polynomial<InK6>;

/// The polynomial x + constant.
template <class Ring>
Polynomial<Ring> variable(Ring constant = Ring(0)) {
  std::vector<Ring> c(2, Ring(1));
  c[0] = constant;
  return Polynomial<Ring>(std::move(c));
}

/// The resultant of 8.5 where K_8 has this value: K_4, then K_6, then K_14 eliminated from p_1 .. p_4.
Residue eliminated_at(const SquareMatrix<Whole>& entries, Residue k8) {
  std::array<Residue, 6> power;  // of K_8, from -1 on, times K_8
  power[0] = 1;
  for (std::size_t k = 1; k < power.size(); ++k)
    power[k] = power[k - 1] * k8;
  const InK4 unknown4 = variable<InK6>();
  const InK4 unknown6(variable<InK14>());
  const InK4 unknown14((InK6(variable<Residue>())));
  InK4 p1;
  InK4 p2;
  InK4 p3;
  InK4 p4;
  for (const auto& row : entries) {
    InK4 error;  // x K_8
    InK4 slope;  // x K_8^2
    std::array<Residue, 3> column{};
    for (std::size_t j = 0; j < kInductionParameters; ++j) {
      const auto [factor, exponent] = kInductionMonomials[j];
      const Residue entry(row[j]);
      const Residue value = entry * power[static_cast<std::size_t>(exponent + 1)];
      const InK4 of = factor == InductionFactor::kK4    ? unknown4
                      : factor == InductionFactor::kK6  ? unknown6
                      : factor == InductionFactor::kK14 ? unknown14
                                                        : InK4(1);
      const auto constant = [](Residue x) { return InK4(InK6(InK14(x))); };
      error = error + constant(value) * of;
      slope = slope + constant(Residue(exponent) * value) * of;  // K_8^2 d/dK_8 K_8^e = e K_8^(e+1)
      if (factor != InductionFactor::kOne) {
        const std::size_t at = factor == InductionFactor::kK4 ? 0 : factor == InductionFactor::kK6 ? 1 : 2;
        column[at] = column[at] + entry * power[static_cast<std::size_t>(exponent + 1)];
      }
    }
    const Residue y(row[kInductionParameters]);
    error = error - InK4(InK6(InK14(y * k8)));
    const auto times = [&](std::size_t at) { return error * InK4(InK6(InK14(column[at]))); };
    p1 = p1 + times(0);
    p2 = p2 + times(1);
    p4 = p4 + times(2);
    p3 = p3 + error * slope;
  }
  // `column` carries a factor K_8 too many: p_1, p_2, p_4 are K_8 dE^2/dK/2 after it is taken out.
  const InK4 inverse(InK6(InK14(k8.inverse())));
  p1 = p1 * inverse;
  p2 = p2 * inverse;
  p4 = p4 * inverse;
  const InK6 r12 = resultant(p1, p2);
  const InK6 r13 = resultant(p1, p3);
  const InK6 r14 = resultant(p1, p4);
  return resultant(resultant(r12, r13), resultant(r12, r14));
}

/// The polynomial of the lowest degree through values at 1, 2, 3, ...
Polynomial<Residue> interpolated(std::vector<Residue> values) {
  for (std::size_t order = 1; order < values.size(); ++order) {
    const Residue step = Residue(static_cast<int>(order)).inverse();
    for (std::size_t k = values.size() - 1; k >= order; --k)
      values[k] = (values[k] - values[k - 1]) * step;
  }
  Polynomial<Residue> p;
  for (std::size_t k = values.size(); k-- > 0;)
    p = p * variable(Residue(-static_cast<int>(k) - 1)) + Polynomial<Residue>(values[k]);
  return p;
}

Polynomial<Residue> remainder(std::vector<Residue> p, const std::vector<Residue>& by) {
  const Residue lead = by.back().inverse();
  while (p.size() >= by.size()) {
    const Residue factor = p.back() * lead;
    for (std::size_t k = 0; k < by.size(); ++k)
      p[p.size() - by.size() + k] = p[p.size() - by.size() + k] - factor * by[k];
    p.pop_back();
  }
  return Polynomial<Residue>(p);
}

// The book's elimination by resultants has degree 104 as it says, and is divisible by the polynomial of
// degree 42 whose roots the search takes: every stationary point of the one is a root of the other. Exact, in
// residues of a prime of 61 bits, so that a false division passes with a probability of 1e-17. Catches: any
// coefficient of either.
TEST(InductionSearch, TheEliminationOfTheBookHasTheSameRoots) {
  const Triangle factor = some_data(0.3, 4);
  const SquareMatrix<Whole> entries = whole_entries(factor);
  std::vector<Residue> values;
  for (int x = 1; x <= 120; ++x)
    values.push_back(eliminated_at(entries, Residue(x)));
  const Polynomial<Residue> book = interpolated(values);
  EXPECT_EQ(book.degree(), 104);
  std::vector<Residue> ours;
  const WholePolynomial p = induction_polynomial(factor);
  for (const Whole& c : p.coefficients())
    ours.push_back(Residue(c));
  EXPECT_EQ(ours.size(), 43U);
  EXPECT_TRUE(remainder(book.coefficients(), ours).is_zero());
}

}  // namespace
}  // namespace drivebench::identification::induction_search_test
