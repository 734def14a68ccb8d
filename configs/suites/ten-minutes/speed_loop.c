/* The same device under test in C: cc speed_loop.c $(pkg-config --cflags --libs drivebench) -lm -o speed_loop */
#include <drivebench.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

int main(void) {
  const double wanted_rad_s = 50.0, proportional_v_s = 0.2, integral_gain_v = 5.0, limit_v = 40.0;
  drivebench_bench* bench;
  if (drivebench_open(getenv("DRIVEBENCH_LINK"), NULL, &bench) != 0 || drivebench_acquire(bench, 0) != 0) {
    return fprintf(stderr, "%s\n", drivebench_error(NULL)), 1;
  }
  const double period_s = drivebench_describe(bench)->period_s;
  double integral_v = 0.0;
  drivebench_command command = {.gates = DRIVEBENCH_GATES_VOLTAGE};
  drivebench_sample sample;
  int code = drivebench_newest(bench, 0, &sample);
  while (code == DRIVEBENCH_OK) {
    const double error_rad_s = wanted_rad_s - sample.speed_rad_s;
    command.tick = sample.tick;
    command.setpoint_a = fmax(-limit_v, fmin(limit_v, proportional_v_s * error_rad_s + integral_v));
    if (fabs(command.setpoint_a) < limit_v) integral_v += integral_gain_v * error_rad_s * period_s;
    code = drivebench_step(bench, &command, 1, &sample);
  }
  printf("the bench ended at %.3f s\n", (double)sample.tick * period_s);
  drivebench_close(bench);
  return code == DRIVEBENCH_LINK_LOST ? 0 : 1;
}
