#!/usr/bin/python3
"""Field-oriented speed control of a motor of your own, a second long. Argument: the address of its bench, else
that of DRIVEBENCH_LINK. The numbers are those of a data sheet, for 24 V: change them, and the two files that
`drivebench new` makes, to your motor's."""
import math
import os
import sys

import drivebench

KV_RPM_PER_V, LINE_OHM, LINE_H = 270, 0.1, 60e-6  # speed over the peak voltage between two terminals; measured there
POLE_PAIRS, INERTIA_KGM2, COUNTS = 7, 8e-6, 4096
WANTED_RAD_S, CURRENT_LIMIT_A, VOLTAGE_LIMIT_V = 300.0, 30.0, 13.0
PHASE_OHM, PHASE_H = LINE_OHM / 2, LINE_H / 2  # two phases of the star lie between two terminals
FLUX_WB = 30 / (math.pi * KV_RPM_PER_V * math.sqrt(3) * POLE_PAIRS)  # peak of a phase
NM_PER_A = 1.5 * POLE_PAIRS * FLUX_WB  # amplitudes stay as they are: i_q is the peak current of a phase
CURRENT_LOOP_RAD_S, SPEED_LOOP_RAD_S = 2000.0, 100.0


class Pi:
    """A PI controller with a limit; its integral waits while the limit holds."""

    def __init__(self, gain, integral_gain, limit):
        self.gain, self.integral_gain, self.limit, self.integral = gain, integral_gain, limit, 0.0

    def step(self, error, period_s):
        out = self.integral + self.gain * error
        if abs(out) < self.limit:
            self.integral += self.integral_gain * period_s * error
        return max(-self.limit, min(self.limit, out))


def turned(x, y, angle):
    """A vector turned by an angle: Park's transform with -angle, its inverse with +angle."""
    return x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)


d_loop, q_loop = (Pi(PHASE_H * CURRENT_LOOP_RAD_S, PHASE_OHM * CURRENT_LOOP_RAD_S, VOLTAGE_LIMIT_V) for _ in "dq")
speed_gain = INERTIA_KGM2 * SPEED_LOOP_RAD_S / NM_PER_A
speed_loop = Pi(speed_gain, speed_gain * SPEED_LOOP_RAD_S / 4, CURRENT_LIMIT_A)

address = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("DRIVEBENCH_LINK")
if address is None:
    sys.exit("own_motor.py: which bench? inproc:my-bench.toml in this process, or a server such as tcp:127.0.0.1:7300")

with drivebench.Bench(address, clear=True) as bench:
    bench.acquire()
    about = bench.describe()
    sample = bench.newest()
    end, count, speed_rad_s = sample.tick + round(1 / about.period_s), sample.encoder_count, 0.0
    while sample.tick < end:
        moved_rad = (sample.encoder_count - count) * 2 * math.pi / COUNTS
        speed_rad_s += 0.05 * (moved_rad / about.period_s - speed_rad_s)
        count, omega = sample.encoder_count, POLE_PAIRS * speed_rad_s
        angle = POLE_PAIRS * count * 2 * math.pi / COUNTS  # zero where the magnet points at phase a
        i_d, i_q = turned(sample.i_a_a, (sample.i_a_a + 2 * sample.i_b_a) / math.sqrt(3), -angle)
        wanted_a = speed_loop.step(WANTED_RAD_S - speed_rad_s, about.period_s)
        u_d = d_loop.step(-i_d, about.period_s) - omega * PHASE_H * i_q
        u_q = q_loop.step(wanted_a - i_q, about.period_s) + omega * (PHASE_H * i_d + FLUX_WB)
        ahead = omega * (0.5 + about.command_delay_ticks) * about.period_s  # where the rotor is while the voltage acts
        alpha, beta = turned(u_d, u_q, angle + ahead)
        a, half = alpha, math.sqrt(3) / 2 * beta
        sample = bench.step(voltages=(a, half - a / 2, -half - a / 2))
    print(f"{sample.speed_rad_s:.1f} rad/s of {WANTED_RAD_S:.1f}, i_q {i_q:.2f} A")
