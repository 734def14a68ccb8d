#include "plant/math/trig.hpp"

// A conversion that this project's own warnings would name: they stay with its own files.
static int rounded(double value) {
  int whole = value;
  return whole;
}

int main() {
  return rounded(drivebench::cos_sin(0.0).cos) == 1 ? 0 : 1;
}
