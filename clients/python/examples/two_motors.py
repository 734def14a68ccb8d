#!/usr/bin/python3
"""Two PM motors on one amplifier (the book, chapter 9, exercise 9): both get the same u_a and u_b, and each makes its own move.

    drivebench-server configs/benches/two-steppers.toml
    clients/python/examples/two_motors.py [host:port] [--damping 0.1] [--bindings FOLDER]

The controller wants the voltage v_q = -u_a sin(n_p th) + u_b cos(n_p th) across the q axis of each rotor. The determinant of the two
equations is sin(n_p (th_2 - th_1)): at 0 both q axes lie on one line, and no u_a, u_b has two different components. Below NEAR least
squares with damping take the place of the inverse; the voltage never exceeds LIMIT_V. The d currents follow as they must. They
give no torque, but heat. Both motors run up together a quarter of an electrical turn apart, where the determinant is 1; then the
second falls back by half an electrical turn, through 0 to -1.

The bench has an amplifier for each axis. Both get the same command in one exchange; ideal voltage amplifiers then are one, whose
current is the sum. --bindings names a folder with bench_pb2.py; without it, protoc makes one."""
import argparse
import math
import os
import socket
import struct
import subprocess
import sys
import tempfile

POLE_PAIRS, RESISTANCE_OHM, INDUCTANCE_H, TORQUE_NM_PER_A, FRICTION_NMS = 50, 0.55, 1.5e-3, 0.19, 8e-4
INERTIAS_KGM2, COUNTS = (4.5e-5, 9e-5), 50000
LIMIT_V, MOST_A, NEAR = 3.0, 1.5, 0.3
POLE_PER_S, OBSERVER_PER_S, CURRENT_V_PER_A = 100.0, 1500.0, 3.0
QUARTER_RAD = 0.5 * math.pi / POLE_PAIRS  # of an electrical turn: one full step
REST_S, RUN_UP_S, SPEED_RAD_S = 1.0, 0.3, 4.0
FALL_BACK_AT_S, FALL_BACK_S = 0.6, 0.1
WINDOWS = (("run-up", 0.0, 0.4), ("together", 0.4, 0.6), ("through zero", 0.6, 0.75), ("behind", 0.75, 1.0))


def blend(x):
    """From 0 to 1 while x does, with the first two derivatives, which are 0 at both ends; then its integral."""
    x = min(max(x, 0.0), 1.0)
    return (x**3 * (10 - 15 * x + 6 * x * x), 30 * (x * (1 - x))**2, 60 * x * (1 - x) * (1 - 2 * x),
            x**4 * (2.5 - 3 * x + x * x))


def references(time_s):
    """(angle, speed, acceleration) of both since the start."""
    part, slope, _, passed = blend(time_s / RUN_UP_S)
    way = SPEED_RAD_S * (RUN_UP_S * passed + max(time_s - RUN_UP_S, 0.0))
    first = (way, SPEED_RAD_S * part, SPEED_RAD_S * slope / RUN_UP_S)
    moved, rate, change, _ = blend((time_s - FALL_BACK_AT_S) / FALL_BACK_S)
    back = (moved, rate / FALL_BACK_S, change / FALL_BACK_S**2)
    return first, tuple(x - 2 * QUARTER_RAD * b for x, b in zip(first, back))


def shared_voltages(angles_rad, wanted_v, damping):
    """u_a, u_b with the wanted q components at these electrical angles, or the nearest ones: u = A' (A A' + d I)^-1 v."""
    rows = [(-math.sin(angle), math.cos(angle)) for angle in angles_rad]
    cross = math.cos(angles_rad[1] - angles_rad[0])
    near = max(1.0 - abs(determinant_of(angles_rad)) / NEAR, 0.0)
    diagonal = 1.0 + (damping * near)**2
    scale = max(diagonal**2 - cross**2, 1e-12)
    weights = ((diagonal * wanted_v[0] - cross * wanted_v[1]) / scale, (diagonal * wanted_v[1] - cross * wanted_v[0]) / scale)
    u = [rows[0][k] * weights[0] + rows[1][k] * weights[1] for k in (0, 1)]
    excess = max(abs(u[0]), abs(u[1])) / LIMIT_V
    return [x / max(excess, 1.0) for x in u]


def determinant_of(angles_rad):
    return math.sin(angles_rad[1] - angles_rad[0])


def angle_of(sample):
    return sample.encoder_count * 2 * math.pi / COUNTS


class Motor:
    """Position control of one motor by state feedback; its output is the wanted v_q."""

    def __init__(self, inertia_kgm2, sample, period_s):
        self.inertia_kgm2, self.period_s, self.start_rad = inertia_kgm2, period_s, angle_of(sample)
        self.angle_rad, self.speed_rad_s, self.integral, self.error_rad = self.start_rad, 0.0, 0.0, 0.0

    def observe(self, measured_rad):
        """A tracking observer with a double pole."""
        self.angle_rad += self.period_s * self.speed_rad_s
        error = measured_rad - self.angle_rad
        self.angle_rad += 2 * OBSERVER_PER_S * self.period_s * error
        self.speed_rad_s += OBSERVER_PER_S**2 * self.period_s * error

    def wanted_v(self, sample, reference, integrates):
        measured_rad = angle_of(sample)
        self.observe(measured_rad)
        angle, speed, acceleration = reference
        self.error_rad = self.start_rad + angle - measured_rad
        if integrates:
            self.integral += self.period_s * self.error_rad
        r = POLE_PER_S
        wanted = acceleration + 3 * r * (speed - self.speed_rad_s) + 3 * r * r * self.error_rad + r**3 * self.integral
        wanted_a = (self.inertia_kgm2 * wanted + FRICTION_NMS * speed) / TORQUE_NM_PER_A
        wanted_a = min(max(wanted_a, -MOST_A), MOST_A)
        c, s = math.cos(POLE_PAIRS * measured_rad), math.sin(POLE_PAIRS * measured_rad)
        i_d, i_q = sample.i_a_a * c + sample.i_b_a * s, sample.i_b_a * c - sample.i_a_a * s
        emf_v = (TORQUE_NM_PER_A + POLE_PAIRS * INDUCTANCE_H * i_d) * self.speed_rad_s
        return RESISTANCE_OHM * wanted_a + emf_v + CURRENT_V_PER_A * (wanted_a - i_q)


class Link:
    """Requests over TCP, each with its answer: a frame is a 4-byte big-endian length, then one Envelope."""

    def __init__(self, address, bindings):
        folder = bindings or tempfile.mkdtemp()
        if not os.path.exists(os.path.join(folder, "bench_pb2.py")):
            protocols = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../../protocols")
            subprocess.run(["protoc", "-I", protocols, "--python_out", folder, "bench.proto"], check=True)
        sys.path.insert(0, folder)
        try:
            import bench_pb2
        except ImportError as error:
            sys.exit(f"{error}: {sys.executable} lacks protobuf; Debian's /usr/bin/python3 has it with the package python3-protobuf")
        self.v1 = bench_pb2
        host, port = address.removeprefix("tcp:").rsplit(":", 1)
        try:
            self.stream = socket.create_connection((host, int(port)), timeout=10)
        except OSError as error:
            sys.exit(f"no bench at {address}: {error}")
        self.stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.reader = self.stream.makefile("rb")
        hello = self.v1.Hello(protocol_min=1, protocol_max=1, client="two_motors.py")
        self.bench = self.ask(hello=hello).welcome.bench

    def ask(self, **request):
        payload = self.v1.Envelope(id=1, **request).SerializeToString()
        self.stream.sendall(struct.pack(">I", len(payload)) + payload)
        answer = self.v1.Envelope()
        while answer.id != 1:  # 0 is no answer but a notice
            head = self.reader.read(4)
            if len(head) < 4:
                sys.exit("the bench has closed the connection")
            answer = self.v1.Envelope.FromString(self.reader.read(struct.unpack(">I", head)[0]))
        if answer.HasField("refusal"):
            sys.exit(f"refused: {answer.refusal.message}")
        return answer

    def lease(self, action):
        for axis in (0, 1):
            self.ask(lease=self.v1.LeaseRequest(axis=axis, action=action))

    def samples(self):
        return [reply.sample for reply in self.ask(exchange=self.v1.Exchange()).exchange_reply.samples]

    def exchange(self, samples, **command):
        """The same command for both axes, in one request."""
        commands = [self.v1.Command(axis=axis, tick=sample.tick, **command) for axis, sample in enumerate(samples)]
        replies = self.ask(exchange=self.v1.Exchange(commands=commands)).exchange_reply.samples
        return [reply.sample for reply in sorted(replies, key=lambda reply: reply.axis)]


def move(link, samples, damping):
    """Rows of time, both errors, largest voltage, largest current of the amplifier, determinant."""
    period_s = link.bench.period_s
    first_tick = samples[0].tick
    motors = [Motor(inertia, sample, period_s) for inertia, sample in zip(INERTIAS_KGM2, samples)]
    rows = []
    while (time_s := (samples[0].tick - first_tick) * period_s) < WINDOWS[-1][2]:
        angles = [POLE_PAIRS * angle_of(sample) for sample in samples]
        determinant = determinant_of(angles)
        wanted_v = [motor.wanted_v(sample, reference, abs(determinant) > NEAR)
                    for motor, sample, reference in zip(motors, samples, references(time_s))]
        u = shared_voltages(angles, wanted_v, damping)
        first, second = samples
        total_a = max(abs(first.i_a_a + second.i_a_a), abs(first.i_b_a + second.i_b_a))
        rows.append((time_s, motors[0].error_rad, motors[1].error_rad, max(map(abs, u)), total_a, abs(determinant)))
        samples = link.exchange(samples, gates=link.v1.GATES_VOLTAGE, u_a_v=u[0], u_b_v=u[1])
        if any(sample.state != 1 for sample in samples):
            sys.exit(f"the bench stopped driving after {time_s:.4f} s: fault words {samples[0].faults:#x} and {samples[1].faults:#x}")
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", nargs="?", default="127.0.0.1:7300")
    parser.add_argument("--damping", type=float, default=0.1)
    parser.add_argument("--bindings")
    arguments = parser.parse_args()
    link = Link(arguments.address, arguments.bindings)
    if link.bench.name != "two-steppers":
        sys.exit(f"the bench is {link.bench.name}; the numbers of this program are those of configs/benches/two-steppers.toml")
    link.lease(link.v1.LeaseRequest.ACTION_ACQUIRE)
    samples = link.samples()
    while samples[0].tick * link.bench.period_s < REST_S:  # the push at tick 0 has turned the second rotor then
        samples = link.exchange(samples, gates=link.v1.GATES_OFF)
    determinant = determinant_of([POLE_PAIRS * angle_of(sample) for sample in samples])
    if abs(determinant) < NEAR:
        sys.exit(f"the determinant is {determinant:.3f} and must be {NEAR} or more to begin with: restart the bench")
    rows = move(link, samples, arguments.damping)
    link.lease(link.v1.LeaseRequest.ACTION_RELEASE)
    print(f"{'largest':14}{'error 1 [deg]':>15}{'error 2 [deg]':>15}{'voltage [V]':>13}{'current [A]':>13}{'least |det|':>13}")
    for name, start, end in WINDOWS:
        part = [row for row in rows if start <= row[0] < end]
        most = [max(abs(row[k]) for row in part) for k in range(1, 5)]
        print(f"{name:14}{math.degrees(most[0]):15.3f}{math.degrees(most[1]):15.3f}{most[2]:13.2f}{most[3]:13.2f}"
              f"{min(row[5] for row in part):13.3f}")


if __name__ == "__main__":
    main()
