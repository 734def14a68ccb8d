#include <drivebench.h>
#include <stdio.h>

/* Spins a DC motor with 12 V for a second and prints its speed. Argument: the address of a bench. */
int main(int argc, char** argv) {
  drivebench_bench* bench;
  if (drivebench_open(argc > 1 ? argv[1] : "inproc:dc-a-voltage", NULL, &bench) != 0) {
    return fprintf(stderr, "%s\n", drivebench_error(NULL)), 1;
  }
  drivebench_acquire(bench, 0);
  drivebench_command command = {.gates = DRIVEBENCH_GATES_VOLTAGE, .setpoint_a = 12.0};
  drivebench_sample sample;
  while (drivebench_step(bench, &command, 1, &sample) == 0 && sample.tick < 10000)
    command.tick = sample.tick;
  printf("%.3f rad/s at %.3f A %s\n", sample.speed_rad_s, sample.i_a_a, drivebench_error(bench));
  drivebench_close(bench);
}
