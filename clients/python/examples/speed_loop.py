#!/usr/bin/python3
"""Holds the speed of a DC motor with a PI loop. Argument: the address of a bench, else one in this process."""
import sys

import drivebench

with drivebench.Bench(sys.argv[1] if len(sys.argv) > 1 else "inproc:dc-a-voltage") as bench:
    bench.acquire()  # the lease of axis 0: only its holder may command
    wanted_rad_s, integral_v, period_s = 50.0, 0.0, bench.describe().period_s
    sample = bench.newest()
    while sample.tick < 5000:  # half a second at 10 kHz
        error_rad_s = wanted_rad_s - sample.speed_rad_s
        integral_v += 5.0 * error_rad_s * period_s
        sample = bench.step(voltages=0.2 * error_rad_s + integral_v)
    print(f"{sample.speed_rad_s:.3f} rad/s of {wanted_rad_s:.3f}, hash {bench.state_hash():016x}")
