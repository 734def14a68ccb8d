#!/usr/bin/python3
"""Starts the motor open loop over the wire: a rotating voltage, u/f, up to 20 Hz. [host:port] [folder of bench_pb2]"""
import importlib.util, math, os, socket, struct, subprocess, sys, tempfile

address = sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:7300"
generated = sys.argv[2] if len(sys.argv) > 2 else tempfile.mkdtemp()
if not os.path.exists(os.path.join(generated, "bench_pb2.py")):
    protocols = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../../protocols")
    subprocess.run(["protoc", "-I", protocols, "--python_out", generated, "bench.proto"], check=True)
if importlib.util.find_spec("google") is None:
    sys.exit(f"{sys.executable} lacks protobuf; Debian's /usr/bin/python3 has it with the package python3-protobuf")
sys.path.insert(0, generated)
import bench_pb2 as v1
stream = socket.create_connection(address.removeprefix("tcp:").rsplit(":", 1), timeout=5)
stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
reader = stream.makefile("rb")

def ask(**request):  # a frame: 4-byte big-endian length, then one Envelope
    payload = v1.Envelope(id=1, **request).SerializeToString()
    stream.sendall(struct.pack(">I", len(payload)) + payload)
    while (answer := v1.Envelope.FromString(reader.read(struct.unpack(">I", reader.read(4))[0]))).id != 1:
        pass  # 0 is no answer but a notice
    if answer.HasField("refusal"):
        sys.exit(f"refused: {answer.refusal.message}")
    return answer

bench = ask(hello=v1.Hello(protocol_min=1, protocol_max=1, client="open_loop_start.py")).welcome.bench
ask(lease=v1.LeaseRequest(axis=0, action=v1.LeaseRequest.ACTION_ACQUIRE))
sample = ask(exchange=v1.Exchange()).exchange_reply.samples[0].sample
start, angle, shown, time_s = sample.tick, 0.0, -1.0, 0.0
while time_s < 1.0:
    time_s = (sample.tick - start) * bench.period_s
    frequency = 20.0 * min(time_s / 0.8, 1.0)
    angle, u = 2 * math.pi * (frequency * time_s - min(time_s, 0.8) * frequency / 2), 10.0 + 1.0 * frequency
    if time_s >= shown + 0.1:
        print(f"{time_s:.1f} s  {frequency:4.1f} Hz  {sample.speed_rad_s:7.2f} rad/s  i_a {sample.i_a_a:6.2f} A")
        shown = time_s
    command = v1.Command(axis=0, tick=sample.tick, gates=v1.GATES_VOLTAGE, u_a_v=u * math.cos(angle), u_b_v=u * math.sin(angle))
    sample = ask(exchange=v1.Exchange(commands=[command])).exchange_reply.samples[0].sample
ask(lease=v1.LeaseRequest(axis=0, action=v1.LeaseRequest.ACTION_RELEASE))
