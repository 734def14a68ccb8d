#!/usr/bin/python3
"""Writes tests/fuzz/corpus anew from real messages: needed when bench.proto, the bench files or the recorder change.

    /usr/bin/python3 tests/fuzz/make_corpus.py

Recordings lose their schemas' text (15 KB) and their checksums (0: not given), so that mutations get past them."""
import pathlib
import re
import struct
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "helpers"))
from recording_parts import (  # noqa: E402
    ATTACHMENT, MESSAGE, channel_of, configuration_of, put_together, taken_apart, text, with_configuration)
from wire_client import BENCHES, Server, frame, pb  # noqa: E402


def put(target, name, data):
    folder = HERE / "corpus" / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data)


def record_a_run(path):
    """Six ticks with every kind of input that a client can give."""
    with Server("--record", str(path)) as server, server.client() as client:
        client.lease()
        client.step(0, 10.0, -5.0)
        client.ask(set_load=pb.SetLoad(load_nm=0.1, ramp_ticks=3, at_tick=2))
        client.ask(write_parameter=pb.WriteParameter(name="machine.rotor_resistance_ohm", value=5.85))
        client.ask(write_parameter=pb.WriteParameter(name="amplifier.gain", value=1.5, ramp_ticks=3, at_tick=2))
        client.ask(inject_fault=pb.InjectFault(name="bus_sag", value=0.25, at_tick=3))
        client.ask(shaft_bump=pb.ShaftBump(impulse_nms=-1e-5, at_tick=2))
        client.ask(clear_faults=pb.ClearFaults())
        for tick in range(1, 6):
            client.step(tick, 20.0, 3.0, gates=pb.GATES_ZERO if tick == 4 else pb.GATES_VOLTAGE)
        client.exchange(2)  # refused: stale
        client.exchange(6, gates=pb.GATES_CURRENT)  # refused: no current loop
        client.close()
        if server.stop() != 0:
            raise RuntimeError(server.errors())


MULTISINES = """
[[axis.multisine]]
load_nm = 5e-4
from_hz = 2.0
to_hz = 500.0
period_s = 0.5
periods = 6
at_s = 0.2
[[axis.multisine]]
current_offset_a = 0.01
from_hz = 10.0
to_hz = 100.0
period_ticks = 800
periods = 2
ratio = 1.3
when = "speed_rad_s > 10"
for_s = 0.01
"""
# Every kind of step, a matrix, draws, and checks with a formula, a reference and a response.
STEPS = """bench = "servo"
duration_s = 0.5
[dut]
command = ["./loop"]
link = "can"
[[step]]
at_s = 0.1
line = "speed 100"
[[step]]
when = "speed_rad_s > 10"
for_s = 0.01
delay_s = 0.02
can = {id = 0x201, data = "0f 00", fd = false}
[[step]]
at_s = 0.2
modbus = {to = "127.0.0.1:1502", unit = 7, register = 100, values = [1500, 2]}
[[step]]
at_s = 0.2
multisine = {load_nm = 5e-4, from_hz = 2.0, to_hz = 500.0, period_s = 0.05, periods = 6}
[[step]]
at_s = 0.3
parameter = "mechanics.friction_nms"
value = 1e-4
ramp_s = 0.1
[[step]]
at_s = 0.3
fault = "open_phase"
value = 2
[[check]]
kind = "energy"
formula = "2.5 [ohm]*i_a_a^2 - max(servo.torque_nm, 0 [N*m])*abs(-speed_rad_s)"
max = 10.0
[[check]]
kind = "tube"
signal = "i_a_a"
reference = "book/8.2.2"
abs = 0.5
[[check]]
kind = "frequency_response"
min_phase_margin_deg = 40.0
[matrix]
step.5.value = [1, 2]
[draw]
count = 2
seed = 7
[draw.of]
check.0.max = {uniform = [1.0, 2.0]}
"""
ATTACHED = """bench = "rig.toml"
mode = "realtime"
duration_s = 2.0
[dut]
attached = "can"
time_limit_s = 30
[dut.can]
backend = "socketcan"
channel = "can0"
[[step]]
at_s = 0.5
load_nm = 0.2
[[check]]
kind = "never"
condition = "state == 4"
"""
MESSAGES = """[[message]]
at_s = 0.1
line = "speed 100"
[[message]]
axis = "two"
when = "one.speed_rad_s > 10"
for_ticks = 5
delay_s = 0.02
can = {id = 0x1fffffff, extended = true, bus = 1, data = "0f 00 10 27 00 00 00 00 00 00 00 01"}
[[message]]
at_tick = 7
modbus = {to = "[::1]:1502", unit = 7, register = 65535, values = [1]}
"""
# Two axes on one shaft, curves, and every kind of scheduled event.
DYNAMOMETER = """
[[axis.set]]
parameter = "machine.rotor_resistance_ohm"
value = 5.85
at_s = 0.1
ramp_s = 0.5
[[axis.fault]]
name = "open_phase"
value = 2
at_tick = 9
until_tick = 12
[[axis.bump]]
at_tick = 3
impulse_nms = -1e-3
[[axis]]
name = "brake"
shares_shaft_with = "servo"
[axis.machine]
kind = "shunt_dc"
armature_resistance_ohm = 1
armature_inductance_h = 0.01
motor_constant = 1
field_resistance_ohm = 100
saturation_curve = [[0, 0], [1, 1],
  [2, 1.5]]
[axis.drive]
kind = "averaged_inverter"
[axis.amplifier]
voltage_limit_v = 80
over_current_a = 6
[axis.encoder]
counts_per_revolution = 2000
"""


# ---- recordings ----

def without_defaults(config):
    """Without the sections of drives and sensors that this bench does not use: mutations shall hit the used ones."""
    used = r"bench|\[axis\]|axis\.(machine|mechanics|drive|amplifier|encoder|current_sensor)"
    sections = re.split(rb"(?m)^(?=\[)", config)
    return b"".join(each for each in sections if re.match(rb"\[(" + used.encode() + rb")\]", each))


def make_recordings(recording):
    parts = taken_apart(recording)
    attachment = parts[ATTACHMENT][0]
    config = configuration_of(attachment)
    put("config", "recorded.toml", config)
    config = without_defaults(config)
    put("recording", "chunked.mcap", put_together(parts, with_configuration(attachment, config), True))
    put("recording", "loose.mcap", put_together(parts, with_configuration(attachment, config), False))
    few = {**parts, MESSAGE: parts[MESSAGE][:6]}
    small = with_configuration(attachment, b"[bench]")
    pairs = text(text("key") + text("value") + text("other") + text(""))
    put("mcap_reader", "chunked.mcap", put_together(few, small, True))
    put("mcap_reader", "loose.mcap", put_together(few, None, False, [text("m") + pairs]))
    inputs = [body[22:] for body in parts[MESSAGE] if b"inputs" in channel_of(parts, body)]
    samples = [body[22:] for body in parts[MESSAGE] if b"sample" in channel_of(parts, body)]
    for i, body in enumerate(dict.fromkeys(inputs)):
        put("envelope", f"input-{i}", body)
    for i in (0, 1, len(samples) - 1):
        put("sample_codec", f"sample-{i}", samples[i])


# ---- the wire ----

# RequestBounds.TCP_05_ASearchFindsNoFrameThatTakesMuch has found these programs of request_program.hpp.
WORST_REQUESTS = {
    "worst-without-bounds": "c31154a6a00fd68a9f4e30219be7e58e",
    "worst-memory": "ee57214f299e6c7284a584988b1f9a95f4e40c121720182e",
    "worst-allocations": "3f6741063ac27b5f55a1f08d687b6eee444b1f99e1712088f6653b07240c31891f0a56bf5c641a99d95cad92da5b05b38d28e53e061bc9ae"
        "0844930e44c3bb72e84c6f5e7a49558632c8ce7688880099c41d10c4761a321a3e9d00f73af2bcb22ee0645dc7dc18b208443b0e45c3bb72",
}


def make_messages():
    extreme = pb.Sample()
    for field in pb.Sample.DESCRIPTOR.fields:
        high = {field.TYPE_UINT64: 2**64 - 1, field.TYPE_SINT64: -2**63}.get(field.type, -1.7976931348623157e308)
        setattr(extreme, field.name, high)
    put("sample_codec", "extreme", extreme.SerializeToString())
    requests = {
        "hello": pb.Envelope(id=1, hello=pb.Hello(protocol_min=1, protocol_max=1, client="fuzz", token="secret")),
        "lease": pb.Envelope(id=2, lease=pb.LeaseRequest(axis=1, action=pb.LeaseRequest.ACTION_ACQUIRE)),
        "exchange": pb.Envelope(id=2**64 - 1, exchange=pb.Exchange(commands=[
            pb.Command(tick=7, gates=pb.GATES_VOLTAGE, u_a_v=-80.0, u_b_v=1e300, u_c_v=-0.0, u_f_v=3.0),
            pb.Command(axis=1, gates=pb.GATES_CURRENT, i_a_a=1.0, i_b_a=-2.0, i_c_a=3.0, i_f_a=-4.0)])),
        "subscribe": pb.Envelope(id=3, subscribe=pb.Subscribe(decimation=8, signals=["i_a_a", "angle_rad"])),
        "trigger": pb.Envelope(id=3, trigger=pb.Trigger(
            condition=pb.TRIGGER_LEAVES, signal="i_a_a", level=-1e300, upper=2.0, bits=2**63, ticks_before=65535, ticks_after=1, hold_off_ticks=2**64 - 1,
            single=True, captured=[pb.CapturedSignals(signals=["i_a_a", "tick"]), pb.CapturedSignals(axis=1, signals=["faults"])])),
        "capture": pb.Envelope(id=3, read_capture=pb.ReadCapture(capture=1, first_row=7)),
        "load": pb.Envelope(id=4, set_load=pb.SetLoad(load_nm=0.1, ramp_ticks=2**64 - 1, at_tick=5)),
        "parameter": pb.Envelope(id=5, write_parameter=pb.WriteParameter(name="amplifier.gain", value=1.5)),
        "ramp": pb.Envelope(id=5, write_parameter=pb.WriteParameter(name="amplifier.gain", value=1.5, ramp_ticks=2**53)),
        "inject": pb.Envelope(id=6, inject_fault=pb.InjectFault(axis=1, name="hall_offset", value=-0.5, at_tick=9)),
        "bump": pb.Envelope(id=7, shaft_bump=pb.ShaftBump(impulse_nms=-1.0, at_tick=2**64 - 1)),
        "reply": pb.Envelope(id=6, exchange_reply=pb.ExchangeReply(samples=[pb.AxisSample(sample=extreme)])),
    }
    for name, message in requests.items():
        put("envelope", name, message.SerializeToString())
        put("request", name, b"\0" + message.SerializeToString())
    for name, program in WORST_REQUESTS.items():
        put("request", name, b"\1" + bytes.fromhex(program))
    stream = b"".join(frame(requests[name].SerializeToString()) for name in ("hello", "lease", "exchange"))
    put("frame_reader", "bytewise", bytes([255, 1, 1]) + stream)
    put("frame_reader", "odd-cuts", bytes([255, 4, 3, 5, 200, 1]) + stream * 3)
    put("frame_reader", "low-cap", bytes([30, 0]) + stream)
    put("frame_reader", "empty-frame", bytes([255, 2, 9, 2]) + stream + bytes(4))


def make_experiments():
    shape, channel = pb.Shape, pb.CHANNEL_A
    shapes = {
        "constant": shape(channel=channel, constant=shape.Constant(value=3.0)),
        "ramp": shape(channel=channel, start_s=0.001, end_s=0.01, ramp=getattr(shape, "Ramp")(**{"from": -1.0, "to": 4.0})),
        "sine": shape(channel=channel, sine=shape.Sine(amplitude=5.0, frequency_hz=60.0, phase_rad=0.3, offset=1.0)),
        "three-phase": shape(three_phase=shape.ThreePhase(amplitude=80.0, frequency_hz=60.0, rise_s=0.01)),
        "chirp": shape(channel=channel, end_s=0.04, chirp=shape.Chirp(amplitude=2.0, from_hz=1.0, to_hz=500.0)),
        "prbs": shape(channel=channel, prbs=shape.Prbs(amplitude=2.0, order=7, bit_ticks=3, seed=9)),
        "multisine": shape(channel=channel, multisine=shape.Multisine(amplitude=0.5, base_hz=10.0, harmonics=[1, 2, 3, 7])),
        "table": shape(channel=channel, table=shape.Table(id=1, interpolate=True)),
    }
    for name, each in shapes.items():
        put("experiment", name, pb.RunExperiment(
            owner="somebody's secret", user="fuzz", label=name, mode=pb.MODE_FREE, ticks=400, decimation=2,
            signals=["i_a_a", "speed_rad_s"], settings=[pb.NamedValue(name="machine.rotor_resistance_ohm", value=5.0)],
            initial=pb.InitialState(speed_rad_s=10.0), stop=pb.StopLimits(current_a=20.0),
            input=pb.ExperimentInput(kind=pb.INPUT_KIND_PHASE_VOLTAGES, shapes=[each])).SerializeToString())
    put("experiment", "dq", pb.RunExperiment(
        owner="somebody's secret", mode=pb.MODE_REALTIME, duration_s=0.05, signals=["i_a_a"],
        input=pb.ExperimentInput(kind=pb.INPUT_KIND_DQ_VOLTAGES, angle=pb.ANGLE_SOURCE_MEASURED, back_emf_vs=0.1, shapes=[
            shape(channel=pb.CHANNEL_Q, constant=shape.Constant(value=3.0))])).SerializeToString())


def make_suites():
    put("suite", "steps.toml", STEPS.encode())
    put("suite", "attached.toml", ATTACHED.encode())
    put("messages", "kinds.toml", MESSAGES.encode())


def make_configs():
    inline = (BENCHES / "servo-realtime.toml").read_text(encoding="utf-8")
    motor = (BENCHES.parent / "motors/servo-im.toml").read_text(encoding="utf-8")
    motor = re.sub(r"^\[", "[axis.", motor[motor.index("[machine]"):], flags=re.M)
    inline = inline.replace('motor = "../motors/servo-im.toml"', 'motor_name = "servo"') + motor
    inline += '[[axis.load]]\nat_s = 0.5\nload_nm = 0.1\nramp_s = 0.01\n'
    put("config", "servo-realtime.toml", re.sub(r"[ ]*#.*", "", inline).encode())
    put("config", "dynamometer.toml", (re.sub(r"[ ]*#.*", "", inline) + DYNAMOMETER).encode())
    put("config", "multisine.toml", (re.sub(r"[ ]*#.*", "", inline) + MULTISINES).encode())
    put("config", "missing-motor.toml", (BENCHES / "servo.toml").read_bytes())
    put("config", "letters.toml", "ä = 1\nn\u0291me = 2\nwin[\u1200\n".encode())  # once undefined behaviour in toml++
    put("config", "oddities.toml", b'bench.name = "\\u00e9\\n"\nbench.mode = \'lockstep\'\nbench = { period_us = 0x7d }\n'
        b'[tcp]\naddress = "0.0.0.0"\nport = 65536\n[[axis]]\nname = """a\nb"""\nx = [1, 2.5, nan, -inf, 1979-05-27]\n')


def make_curves():
    """A byte whose lowest bit says whether y must rise, then the file."""
    for name, text in {"plain": "0,0\n0.5,1e-3\n1,2\n", "header": "t [s],M [N*m]\r\n0 , +1\r\n\r\n2,\t-3\r\n",
                       "mark": "\ufeff-1,-1\n1,1", "falling": "0,1\n1,0\n", "wrong": "0,1\n1;2\nnan,inf\n"}.items():
        put("curve", name, bytes([name == "plain"]) + text.encode())


def make_can_frames():
    """Flags, identifier, size, data. Flags: 1 FD profile, 2 extended profile; 4 FD frame, 8 extended, 16 remote,
    32 error, 64 a profile with wide axes, 128 the identifiers of CANopen."""
    frames = {
        "classic-currents": (0, 0x061, "dc0512fde8032301"),
        "classic-command": (0, 0x031, "d204ffff452301c8"),
        "classic-duties": (0, 0x031, "ff7f0080e8030301"),
        "classic-encoder": (0, 0x041, "feffffffffff0000"),
        "classic-counters": (0, 0x6A1, "ffff020003000402"),
        "fd-sensors": (5, 0x06F, "896745230000803f000000c0feffffff0000c07f6f12033b8867452323020200"),
        "fd-command": (5, 0x031, "452301000000c03f000080be03090000"),
        "fd-edges": (5, 0x6C1, "89674523feffffff021a0000" + "3492ff7f" * 13),
        "fd-request-in-classic": (1, 0x071, "0107efbeadde0000"),
        "extended-heartbeat": (10, 0x790001, "050302077d000000"),
        "remote": (16, 0x031, "0000000000000000"),
        "error": (32, 0x031, "0000000000000000"),
        "wide-phases": (64, 0x055, "dc050cfe89670500"),
        "wide-phase-command": (64, 0x021, "2efb3200452301c8"),
        "wide-currents": (64, 0x031, "0600f8ff07000401"),
        "wide-voltages": (64, 0x7A5, "0089e80330f8f401"),
        "wide-field": (64, 0x7A5, "018960099cffb80b"),
        "wide-speed-sensors": (64, 0x7A5, "0289c800f40106ff"),
        "wide-injected": (64, 0x7A5, "0389010000080000"),
        "wide-no-page": (64, 0x7A5, "0489000000000000"),
        "wide-fd-sensors": (69, 0x065, "896745230000803f000000c0feffffff0000c07f6f12033b8867452323020200"
                            "0000c03f000000bf00004042000000400000003f000080be0000964305000000"),
        "wide-fd-details": (69, 0x7A5, "89674523000020410000a0c10000a0400000c041000080bf0000664300002040"
                            "0000fa430000fac20000403f01000008"),
        "wide-fd-command": (69, 0x031, "452301000000c03f000080be040900000000003f000000c0"),
        "canopen-phases": (192, 0x67F, "dc050cfe89670500"),
        "canopen-heartbeat": (130, 0x701, "050102077d000000"),
        "huge": (0, 0x123, "ffffffffffffef7f"),
        "nan": (5, 0x123, "000000000000f87f"),
    }
    for name, (flags, number, data) in frames.items():
        put("can_frame", name, struct.pack("<BIB", flags, number, len(data) // 2) + bytes.fromhex(data))


def make_modbus_streams():
    """A byte for the size of the reads, then frames of every function."""
    command = struct.pack(">HHHHB", 200, 86, 402, 7, 14) + struct.pack(">HIff", 1, 7, 10.0, -5.0)
    pdus = {
        "reads": [bytes([1, 0, 0, 0, 2]), bytes([2, 0, 0, 0, 27]), struct.pack(">BHH", 3, 0, 30),
                  struct.pack(">BHH", 4, 10200, 86)],
        "writes": [struct.pack(">BHH", 5, 1, 0xFF00), struct.pack(">BHH", 6, 400, 7), bytes([15, 0, 0, 0, 2, 1, 3]),
                   struct.pack(">BHHBHhh", 16, 101, 3, 6, 15, 1000, -1000), struct.pack(">BHHH", 22, 101, 0xFF, 8)],
        "parameters": [struct.pack(">BHHBff", 16, 1000, 4, 8, 0.5, 3.0), struct.pack(">BHHBf", 16, 1004, 2, 4, 1.0)],
        "exchange": [b"\x17" + command],
        "others": [bytes([8, 0, 0, 1, 2]), bytes([43, 14, 1, 0]), bytes([43, 14, 4, 6]), bytes([7]), bytes([17])],
        "wrong": [struct.pack(">BHH", 3, 65535, 126), struct.pack(">BHHBH", 16, 402, 2, 2, 1), bytes([23] + 9 * [0])],
    }
    for name, each in pdus.items():
        frames = [struct.pack(">HHHB", i, 0, len(pdu) + 1, 1) + pdu for i, pdu in enumerate(each)]
        put("modbus", name, b"\x06" + b"".join(frames))
    put("modbus", "length", b"\x00" + bytes([0, 1, 0, 0, 0, 1, 1, 3]))
    put("modbus", "protocol", b"\x00" + bytes([0, 1, 0, 1, 0, 6, 1, 3, 0, 0, 0, 1]))


def make_sessions():
    """Programs of session.cpp: action x 4 + peer, then the values of the action."""
    hello, newest, status, lease, command, both, clear, load, write, inject, bump = 0, 1, 2, 3, 5, 8, 9, 10, 11, 12, 13
    subscribe, read, go_on, reconnect, half_close, experiment, frame_of, stream = 14, 15, 16, 17, 18, 19, 20, 21
    loss = [f.name for f in injectable_faults()].index("command_loss")

    def do(peer, action, *more):
        return bytes([action * 4 + peer, *more])

    axis_0, axis_1, release = 0, 4, 8 * 21  # 8 x 21: action 3, axis 0
    ticks = lambda axis, count: count * 8 + axis  # noqa: E731
    programs = {
        "run": do(0, lease, axis_0) + do(0, go_on, ticks(0, 20)) + do(1, subscribe, 8) + do(0, go_on, ticks(0, 10))
        + do(0, status) + do(0, lease, release),
        "one-by-one": do(0, lease, axis_0) + b"".join(do(0, command, axis_0, 0, 3, 4) for _ in range(8)) + do(0, newest),
        "two-axes": do(0, lease, axis_0) + do(1, lease, axis_1) + b"".join(
            do(0, command, axis_0, 0, 3, 4) + do(1, command, axis_1, 0, 3, 4) for _ in range(6)) + do(1, reconnect, 1),
        "both-at-once": do(2, lease, axis_0) + do(2, lease, axis_1) + do(2, both, 0, 0, 3, 4, 0, 3, 4) * 5 + do(2, half_close, 0),
        "watchdog": do(0, lease, axis_0) + do(0, go_on, ticks(0, 3)) + do(0, inject, axis_0, loss, 1)
        + do(0, go_on, ticks(0, 8)) + do(1, clear, axis_0) + do(0, inject, axis_0, loss, 0) + do(0, clear, axis_0)
        + do(0, go_on, ticks(0, 3)),
        "expiry": do(0, lease, axis_0) + do(1, lease, axis_1) + do(0, go_on, ticks(0, 1)) + do(1, inject, axis_1, loss, 1)
        + do(1, go_on, ticks(4, 30)) + do(0, go_on, ticks(0, 30)) + do(2, lease, axis_1),
        "takeover": do(0, lease, axis_0) + do(0, go_on, ticks(0, 5)) + do(1, lease, axis_0) + do(0, reconnect, 1)
        + do(1, lease, axis_0) + do(1, command, axis_0, 0, 3, 4) + do(1, clear, axis_0) + do(1, go_on, ticks(0, 5)),
        "world": do(0, lease, axis_0) + do(0, load, axis_0, 1) + do(0, write, 128, 2, 8) + do(0, bump, 130, 7)
        + do(0, load, 140, 5) + do(0, go_on, ticks(0, 20)) + do(0, read, axis_0),
        "not-numbers": do(0, lease, axis_0) + b"".join(do(0, command, axis_0, 1, n, n) for n in (11, 12, 13, 14, 15)),
        "abandoned": do(0, lease, axis_0) + do(0, lease, axis_1) + do(0, command, axis_0, 0, 3, 4) + do(0, command, axis_0, 0, 3, 4)
        + do(0, lease, release) + do(0, newest),
        "strangers": do(3, newest) + do(3, reconnect, 0) + do(3, lease, axis_0) + do(3, reconnect, 0) + do(3, hello)
        + do(3, experiment, 0) + do(3, 22, 0),
        "bytes": do(1, frame_of, 4) + pb.Envelope(id=1, status_request=pb.StatusRequest()).SerializeToString()[:4]
        + do(2, stream, 6) + frame(b"\x08\x01") + do(2, stream, 3) + b"\0\0\0",
    }
    for name, program in programs.items():
        put("session", name, program)


def injectable_faults():
    with Server() as server, server.client() as client:
        return client.welcome.bench.injectable_faults


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        run = pathlib.Path(folder) / "run.mcap"
        record_a_run(run)
        make_recordings(run.read_bytes())
    make_messages()
    make_experiments()
    make_configs()
    make_suites()
    make_curves()
    make_modbus_streams()
    make_can_frames()
    make_sessions()
