// drivebench-results: runs the control experiments of the book and prints tests/book/RESULTS.md.
#include <cstdio>

#include "tests/book/results/results.hpp"

int main() {
  std::fputs(drivebench::markdown_of(drivebench::all_results()).c_str(), stdout);
}
