"""A drive controller made of python-can and the bench's DBC file: it knows the frames from the file alone."""
import logging
import math
import time

import can

logging.getLogger("canmatrix.formats").setLevel(logging.ERROR)  # it misses formats that these tests do not need
import canmatrix.formats  # noqa: E402

PATIENCE_S = 30.0
REQUESTS = {"acquire": 1, "renew": 2, "release": 3, "clear_faults": 4}


class Refused(Exception):
    """The bench refused; `code` is the result of its reply."""

    def __init__(self, code):
        super().__init__(f"result {code}")
        self.code = code


class Drive:
    """One axis on a python-can bus, in lockstep."""

    def __init__(self, bus, dbc_file, axis="servo", fd=True):
        self.bus = bus
        self.fd = fd
        self.axis = axis
        self.matrix = canmatrix.formats.loadp_flat(str(dbc_file))
        self.by_id = {(f.arbitration_id.id, bool(f.arbitration_id.extended)): f for f in self.matrix.frames}
        self.lease = 0
        self.received = []  # (name without the axis, values, python-can message)
        self.seen = {}  # newest values by message name

    def frame(self, name):
        found = self.matrix.frame_by_name(f"{self.axis}_{name}") or self.matrix.frame_by_name(name)
        if found is None:
            raise KeyError(name)
        return found

    def message(self, name, **raw):
        frame = self.frame(name)
        data = frame.encode({signal.name: raw.get(signal.name, 0) for signal in frame.signals})
        return can.Message(arbitration_id=frame.arbitration_id.id, is_extended_id=bool(frame.arbitration_id.extended),
                           is_fd=self.fd, bitrate_switch=self.fd, data=bytes(data))

    def send(self, name, **raw):
        self.bus.send(self.message(name, **raw))

    def receive(self, timeout=PATIENCE_S):
        """The next message of this bench: its name."""
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            message = self.bus.recv(left)
            if message is None or message.is_error_frame or message.is_remote_frame:
                continue
            frame = self.by_id.get((message.arbitration_id, bool(message.is_extended_id)))
            if frame is None or len(message.data) != frame.size:  # of another device
                continue
            name = frame.name.removeprefix(self.axis + "_")
            values = {key: value.raw_value if value.signal.is_float else float(value.phys_value)
                      for key, value in frame.decode(bytearray(message.data)).items()}
            self.received.append((name, values, message))
            # A message with pages tells a part at a time.
            self.seen[name] = {**self.seen.get(name, {}), **values} if "page" in values else values
            return name
        raise AssertionError("the bench says nothing")

    def await_message(self, name):
        while self.receive() != name:
            pass
        return self.seen[name]

    def request(self, what, controller=4711, lease=None):
        self.send("request", request=REQUESTS[what], controller=controller,
                  lease=self.lease if lease is None else lease)
        while True:
            reply = self.await_message("reply")
            if reply["request"] == REQUESTS[what] and reply["controller"] == controller:
                break
        if reply["result"] != 0:
            raise Refused(int(reply["result"]))
        return reply

    def acquire(self, controller=4711):
        self.lease = int(self.request("acquire", controller, lease=0)["lease"])
        return self.sample()

    def sample(self):
        """Waits for SYNC: the newest sensors, whose tick it names."""
        tick = int(self.await_message("sync")["tick"])
        if self.fd:
            sensors = self.seen["sensors"]
            assert int(sensors["tick"]) == tick, (sensors, tick)
            return tick, int(sensors["encoder_count"]), sensors["i_a"], sensors["i_b"]
        currents = self.seen["currents"]
        assert int(currents["tick"]) == tick % 65536, (currents, tick)
        return tick, int(self.seen["encoder"]["encoder_count"]), currents["i_a"], currents["i_b"]

    def command(self, tick, u_a, u_b, mode=1, u_c=0.0, u_f=0.0):
        """Sends voltages, scaled by the DBC file; phase c and the field if the axis has a place for them."""
        frame = self.frame("command")
        bits = 32 if self.fd else 16
        factor = 1.0 if self.fd else float(frame.signal_by_name("u_a").factor)
        scaled = (lambda u: u) if self.fd else (lambda u: round(u / factor))
        common = {"tick": tick % (1 << bits), "mode": mode, "lease": self.lease}
        others = {"u_c": scaled(u_c), "u_f": scaled(u_f)}
        if self.matrix.frame_by_name(f"{self.axis}_phase_command") is not None:
            self.send("phase_command", **common, **others)
        self.send("command", **common, **others, u_a=scaled(u_a), u_b=scaled(u_b))

    def step(self, tick, u_a, u_b, **others):
        """One lockstep tick: the sample after it. The command is sent again if it was lost on the way."""
        self.command(tick, u_a, u_b, **others)
        sample = self.sample()
        while sample[0] <= tick:
            sample = self.sample()
        return sample


def open_loop_voltages(tick, period_s=125e-6):
    """An open-loop start: amplitude and frequency rise together."""
    time_s = tick * period_s
    frequency_hz = min(60.0 * time_s / 0.2, 60.0)
    angle = 2.0 * math.pi * (0.5 * frequency_hz * time_s if time_s < 0.2 else frequency_hz * (time_s - 0.1))
    amplitude = 10.0 + 40.0 * frequency_hz / 60.0
    return round(amplitude * math.cos(angle), 2), round(amplitude * math.sin(angle), 2)


def three_phases(u_a, u_b):
    """The power-invariant transform: the voltages of a star for the same motion."""
    root = math.sqrt(2.0 / 3.0)
    u_c = root * (-0.5 * u_a - 0.5 * math.sqrt(3.0) * u_b)
    return round(root * u_a, 2), round(root * (-0.5 * u_a + 0.5 * math.sqrt(3.0) * u_b), 2), round(u_c, 2)


def open_loop_start(drive, ticks):
    """Takes the axis, starts the motor, gives the axis back: (tick, count) of every sample."""
    sample = drive.acquire()
    counts = [sample[:2]]
    while sample[0] < ticks:
        sample = drive.step(sample[0], *open_loop_voltages(sample[0]))
        counts.append(sample[:2])
    drive.request("release")
    return counts
