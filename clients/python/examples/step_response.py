#!/usr/bin/python3
"""A notebook in cells (`# %%`), which editors and Jupyter open: how a DC motor answers a step of voltage, and a load."""
# %% The bench, in this process
import math

import drivebench

bench = drivebench.Bench("inproc:dc-a-voltage")
bench.acquire()
parameters = {name: row.value for name, row in bench.describe().axes[0].parameters.items()}
print(f"{bench.describe().axes[0].machine}: {len(parameters)} parameters, a tick of {bench.describe().period_s * 1e6:.0f} us")

# %% A step of 12 V for half a second, then a load of 20 mN*m on the shaft
with bench.record(["speed_rad_s", "i_a_a", "load_nm"]) as run:
    bench.set_load(0.02, at_tick=5000)
    bench.run(lambda sample: drivebench.Command(voltages=12.0), ticks=10000)
speeds = run["speed_rad_s"]
print(f"{speeds[5000]:.2f} rad/s without a load, {speeds[10000]:.2f} rad/s with it")

# %% The same from the equations: u = R i + k w, k i = B w + load
r = parameters["machine.armature_resistance_ohm"]
k = parameters["machine.torque_constant_nm_per_a"]
b = parameters["mechanics.viscous_friction_nms"]
for load_nm, speed_rad_s in ((0.0, speeds[5000]), (0.02, speeds[10000])):
    expected_rad_s = (k * 12.0 - r * load_nm) / (k * k + r * b)
    assert math.isclose(speed_rad_s, expected_rad_s, rel_tol=1e-6), (speed_rad_s, expected_rad_s)

# %% What the load has changed: run.dataframe() is the same with the time for its index, ready to plot
bench.close()
