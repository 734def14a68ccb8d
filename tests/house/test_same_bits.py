#!/usr/bin/python3
"""No result comes from a function whose last bit the C library chooses by the CPU or by its own version.

plant/math has them with exactly defined bits; of <cmath> only what IEEE 754 rounds exactly may stand in the product:
sqrt, fma, floor, ceil, round, remainder and the like."""
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
INEXACT = re.compile(r"\bstd::(?:a?sinh?|a?cosh?|a?tanh?|atan2|exp|exp2|expm1|log|log2|log10|log1p|pow|hypot|cbrt|polar|arg|lgamma"
                     r"|tgamma|erfc?|normal_distribution|uniform_real_distribution)\b")

# They place what is drawn, to a tenth of a pixel, and calculate nothing else.
PICTURES = ("clients/command/control/plot.cpp", "clients/command/motor/steady_state_plot.cpp", "clients/command/recording/svg_plot.cpp",
            "clients/command/regression/pages/bode_plot.cpp", "clients/regression/timing/timing_page.cpp")


def uses(text):
    """The lines of a source that use such a function, without their comments."""
    return [number for number, line in enumerate(text.splitlines(), 1) if INEXACT.search(line.partition("//")[0])]


class SameBits(unittest.TestCase):
    def test_no_file_uses_a_function_without_defined_bits(self):
        """Catches: std::sin and its relatives in a controller, a check or the plant."""
        found = []
        for top in ("plant", "protocols", "server", "clients"):
            for path in sorted((ROOT / top).rglob("*.[ch]pp")):
                name = path.relative_to(ROOT).as_posix()
                if name not in PICTURES:
                    found += [f"{name}:{line}" for line in uses(path.read_text(encoding="utf-8"))]
        self.assertEqual(found, [], "use plant/math in its place")

    def test_the_exceptions_are_files(self):
        """Catches: an exception that outlives its file."""
        self.assertEqual([name for name in PICTURES if not (ROOT / name).is_file()], [])

    def test_the_search_finds_each_function_and_no_exact_one(self):
        """Catches: a pattern that has gone blind."""
        for name in ("sin", "cos", "tan", "atan2", "asin", "exp", "expm1", "log", "log10", "pow", "hypot", "polar", "tanh"):
            self.assertEqual(uses(f"\nx = std::{name}(y);"), [2], name)
        for text in ("std::sqrt(x)", "std::floor(x)", "std::fma(x, y, z)", "std::remainder(x, y)", "std::ceil(x)", "// std::sin",
                     "std::array<int, 2>", "std::expected"):
            self.assertEqual(uses(text), [], text)


if __name__ == "__main__":
    unittest.main()
