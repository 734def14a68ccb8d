#!/usr/bin/python3
"""The position of a shaft cannot be observed from its speed (the book, problem 2.15).

    drivebench control --csv move.csv
    clients/python/examples/position_from_speed.py move.csv

Runs observers on the file: angle' = speed + l1 e, speed' = l2 e. Each starts 0.1 rad off. With e from the angle the start is
forgotten; with e from the speed it stays, whatever the gains, because the angle never comes into it."""
import csv
import sys


def final_offset(rows, period_s, l1, l2, from_angle):
    """How much of a start 0.1 rad off is left: the difference of two observers of the same samples."""
    near, far = [float(rows[0]["moved_rad"]), 0.0], [float(rows[0]["moved_rad"]) + 0.1, 0.0]
    for row in rows:
        for x in (near, far):
            e = float(row["moved_rad"]) - x[0] if from_angle else float(row["speed_rad_s"]) - x[1]
            x[0], x[1] = x[0] + period_s * (x[1] + l1 * e), x[1] + period_s * l2 * e
    return far[0] - near[0]


def main():
    with open(sys.argv[1], newline="", encoding="utf-8") as file:
        rows = [{name.split(" ")[0]: value for name, value in row.items()} for row in csv.DictReader(file)]
    period_s = float(rows[1]["time_s"]) - float(rows[0]["time_s"])
    for l1, l2, source in ((1000.0, 250e3, "angle"), (1000.0, 2000.0, "speed"), (-500.0, 2000.0, "speed"), (0.0, 50.0, "speed")):
        left_rad = final_offset(rows, period_s, l1, l2, source == "angle")
        print(f"from the {source}, l1 = {l1:g}, l2 = {l2:g}: {left_rad:.6f} rad of 0.100000 left")


if __name__ == "__main__":
    main()
