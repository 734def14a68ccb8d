#!/usr/bin/python3
"""The device under test: a PI loop that holds 50 rad/s. The runner puts its link into the environment."""
import os

import drivebench

WANTED_RAD_S, PROPORTIONAL_V_S, INTEGRAL_V, LIMIT_V = 50.0, 0.2, 5.0, 40.0

with drivebench.Bench(os.environ["DRIVEBENCH_LINK"]) as bench:
    bench.acquire()
    period_s = bench.describe().period_s
    sample, integral_v = bench.newest(), 0.0
    try:
        while True:  # until the bench ends
            error_rad_s = WANTED_RAD_S - sample.speed_rad_s
            voltage_v = max(-LIMIT_V, min(LIMIT_V, PROPORTIONAL_V_S * error_rad_s + integral_v))
            if abs(voltage_v) < LIMIT_V:  # the integral stands still at the limit
                integral_v += INTEGRAL_V * error_rad_s * period_s
            sample = bench.step(voltages=voltage_v)
    except drivebench.LinkLost:
        print(f"the bench ended at {sample.tick * period_s:.3f} s")
