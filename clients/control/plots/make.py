#!/usr/bin/python3
"""Makes the pictures of ../README.md: every preset below on its own bench, recorded by the server and drawn by `drivebench plot`.

    clients/control/plots/make.py [folder of the programs, default build/release/bin [presets, default all]]"""
import json
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
REPOSITORY = HERE.parents[2]
BENCHES = REPOSITORY / "configs/benches"

SERVO = "speed,error,currents,voltages"
PLOTS = (  # preset, panels, title, options of the run
    ("book/8.2.2", SERVO, "half a turn in 73 ms, field-oriented"),
    ("book/8.2.2-clipped", SERVO, "the same, i_q reference clipped to the current circle"),
    ("book/8.2.2-flux-copy", "flux,speed-estimate,error", "on the flux observer (8.35), started 20 mWb off"),
    ("book/8.2.2-verghese-sanders", "flux,speed-estimate,error", "on that of Verghese and Sanders"),
    ("exercise/8.26", "flux,load,speed-estimate", "flux, load and speed observed in rotor coordinates", "--load", "0.1@0.0365"),
    ("exercise/8.27", "flux,speed-estimate,error", "on that of Martin and Rouchon"),
    ("exercise/8.17", SERVO, "by nested P and PI loops"),
    ("book/8.2.5-soft-flux", SERVO, "to 8000 rpm and back, input-output linearisation"),
    ("book/8.2.5-constant-flux", SERVO, "the same with constant flux"),
    ("exercise/8.15b", SERVO, "838 rad/s with 60 V"),
    ("exercise/8.28", SERVO, "dynamic linearisation, integrator on the d axis"),
    ("exercise/8.29", SERVO, "dynamic linearisation, integrator on the q axis, a hoist"),
    ("exercise/8.30", "speed,error,flux,currents", "along the flat outputs, a hoist"),
    ("book/9.1.4", SERVO, "1.8 mm in 30 ms, PM stepper as a servo"),
    ("book/9.7-3000rpm", SERVO, "3000 rpm at 10 kHz"),
    ("book/9.8-22a", "speed,torque,currents,voltages", "run-up at the limits of voltage and current"),
    ("book/9.4-current", "angle,currents", "a step of 1 A"),
    ("stepper/train-400", "angle,currents", "400 steps a second are too many for 1.1 V"),
    ("exercise/9.9", "speed,error,second_error_rad,determinant,currents,voltages", "two motors on one amplifier, through the determinant 0"),
    ("book/9.11", SERVO, "salient PM machine, the least current for its torque"),
    ("book/10.6", SERVO, "brushless DC, six-step, 250 V"),
    ("book/10.6-200v", SERVO, "the same with 200 V"),
    ("wound-rotor/field-weakening", SERVO, "wound rotor to 350 rad/s"),
    ("book/2.18", SERVO, "DC servo, half a turn in 65 ms"),
    ("book/2.25", SERVO, "the same with nested loops"),
    ("book/2.40", "speed,currents,voltages", "separately excited, to 300 rad/s"),
    ("book/2.42", "speed,torque,currents,voltages", "series motor with a fan"),
    ("book/2.44", "speed-estimate,currents,voltages", "series motor, speed from the current alone, no load in the observer"),
    ("book/2.46", "speed,torque,currents,voltages", "shunt motor, exact linearisation"),
)


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def make(programs, presets, preset, panels, title, *options):
    bench = BENCHES / (presets[preset]["bench"] + ".toml")
    with tempfile.TemporaryDirectory() as folder:
        recording = pathlib.Path(folder) / "run.mcap"
        server = subprocess.Popen([programs / "drivebench-server", bench, "--mode", "lockstep", "--port", "0", "--record", recording],
                                  stdout=subprocess.PIPE, text=True)
        try:
            link = "tcp:" + server.stdout.readline().split("tcp=")[1].split()[0]
            run(programs / "drivebench", "control", "--preset", preset, "--link", link, *options)
        finally:
            server.terminate()
            server.communicate()
        out = HERE / (preset.replace("/", "-") + ".svg")
        run(programs / "drivebench", "plot", recording, "--preset", preset, "--panels", panels, "--title", f"{preset}: {title}",
            "--out", out)
        print(f"{out.name} {out.stat().st_size // 1024} KiB")


def main():
    programs = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else REPOSITORY / "build/release/bin").resolve()
    only = sys.argv[2:]
    presets = {each["name"]: each for each in json.loads(run(programs / "drivebench", "control", "--list", "--json"))}
    for plot in (each for each in PLOTS if not only or each[0] in only):
        make(programs, presets, *plot)


if __name__ == "__main__":
    main()
