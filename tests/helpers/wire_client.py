"""A server process and a blocking client for the wire tests: frames of bench.proto over TCP or a unix socket."""
import array
import atexit
import importlib
import json
import os
import pathlib
import shutil
import socket
import struct
import subprocess
import sys
import tempfile

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
SERVER = pathlib.Path(os.environ.get("DRIVEBENCH_SERVER", REPOSITORY / "build/release/bin/drivebench-server"))
PROTO = REPOSITORY / "protocols/bench.proto"
BENCHES = REPOSITORY / "configs/benches"

# The longest that anything may take before a test calls it a hang. No test measures time.
PATIENCE_S = 30.0


def _generated():
    folder = tempfile.mkdtemp(prefix="drivebench-pb2-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    subprocess.run(["protoc", f"--python_out={folder}", f"-I{PROTO.parent}", str(PROTO)], check=True)
    sys.path.insert(0, folder)
    return importlib.import_module("bench_pb2")


pb = _generated()


def guarded(environment):
    """The environment of a program that ends if a tick makes a call that could wait (tests/adversity/guard); keeps other
    preloads."""
    guard = os.environ.get("DRIVEBENCH_GUARD")
    if not guard:
        return environment
    others = environment.get("LD_PRELOAD")
    return {**environment, "LD_PRELOAD": f"{guard}:{others}" if others else guard}


class Closed(Exception):
    """The server ended the connection."""


def frame(payload):
    return struct.pack(">I", len(payload)) + payload


def patient(text):
    """A bench on which lateness in real time is counted, as everywhere, and is no fault: the machine may be busy."""
    return text if "[realtime]" in text else text + "\n[realtime]\nmax_lateness_ms = 60000\n"


class Server:
    """A drivebench-server on ports of its own; ended with the `with` block. A test of the fault for lateness asks for a
    strict bench."""

    def __init__(self, *options, config=None, text=None, unix=False, before=None, strict=False):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-wire-"))
        if text is None and config is None and "realtime" in options:
            text = (BENCHES / "servo.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
        if text is not None and not strict:
            text = patient(text)
        config = config or BENCHES / "servo.toml"
        if text is not None:
            config = self.folder / "bench.toml"
            config.write_text(text, encoding="utf-8")
        self.unix_path = str(self.folder / "bench.sock") if unix else None
        command = [str(SERVER), str(config), "--port", "0", "--json", *options]
        if unix:
            command += ["--unix", self.unix_path]
        self.log = open(self.folder / "stderr", "w+", encoding="utf-8")
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.log, text=True, preexec_fn=before,
                                        env=guarded(os.environ))
        line = self.process.stdout.readline()
        if not line:
            self.process.wait()
            raise RuntimeError(f"the server did not start: {self.errors()}")
        self.ready = json.loads(line)
        host, port = self.ready["tcp"].rsplit(":", 1)
        self.address = (host, int(port))
        self.verdict = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            if "DRIVEBENCH_COVERAGE" in os.environ:  # counts are written at the end of a program
                self.process.terminate()
                self.process.stdout.read()
            else:
                self.process.kill()
            self.process.wait()
        self.process.stdout.close()
        self.log.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def errors(self):
        self.log.flush()
        return (self.folder / "stderr").read_text(encoding="utf-8")

    def memory_kib(self, which="VmHWM"):
        """Its memory by the kernel: now (VmRSS), or at most (VmHWM)."""
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text(encoding="utf-8")
        return int(next(line for line in status.splitlines() if line.startswith(which)).split()[1])

    def stop(self, number=15):
        """Ends it with a signal and returns the exit code. The verdict it printed is then in `verdict`."""
        self.process.send_signal(number)
        out, _ = self.process.communicate(timeout=PATIENCE_S)
        lines = [json.loads(line) for line in out.splitlines()]
        self.verdict = next((line for line in lines if line["event"] == "verdict"), None)
        return self.process.returncode

    def raw(self, receive_buffer=None, unix=False, source=None):
        """A connection; `source` is an address of this computer other than 127.0.0.1."""
        s = socket.socket(socket.AF_UNIX if unix else socket.AF_INET, socket.SOCK_STREAM)
        if receive_buffer:
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        s.settimeout(PATIENCE_S)
        if source:
            s.bind((source, 0))
        s.connect(self.unix_path if unix else self.address)
        if not unix:
            s.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return s

    def client(self, hello=True, token="", conducts=False, **options):
        return Client(self.raw(**options), hello, token, conducts)


class Client:
    """One connection. Messages without a request are kept in `samples`, `triggered` and `notices`."""

    def __init__(self, sock, hello=True, token="", conducts=False):
        self.socket = sock
        self.samples = []
        self.triggered = []
        self.notices = []
        self.last_id = 0
        self.owner = 0
        self.welcome = None
        self.buffer = b""
        if hello:
            self.welcome = self.hello(token, conducts=conducts).welcome

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self.socket.close()

    def hello(self, token="", name="wire test", conducts=False):
        return self.ask(hello=pb.Hello(protocol_min=1, protocol_max=1, client=name, token=token, conducts=conducts))

    def send_bytes(self, data):
        self.socket.sendall(data)

    def send(self, **kind):
        self.last_id += 1
        self.send_bytes(frame(pb.Envelope(id=self.last_id, **kind).SerializeToString()))
        return self.last_id

    def ask_for_descriptors(self, **kind):
        """The answer, and the descriptors that came with its first byte; the caller closes them."""
        number = self.send(**kind)
        data, rights, _, _ = self.socket.recvmsg(1 << 16, socket.CMSG_SPACE(8 * 4))
        self.buffer += data
        descriptors = array.array("i")
        for level, meaning, content in rights:
            if (level, meaning) == (socket.SOL_SOCKET, socket.SCM_RIGHTS):
                descriptors.frombytes(content)
        return self.answer_to(number), descriptors

    def receive_bytes(self, count):
        while len(self.buffer) < count:
            try:
                got = self.socket.recv(1 << 16)
            except (ConnectionResetError, BrokenPipeError):
                got = b""
            if not got:
                raise Closed
            self.buffer += got
        data, self.buffer = self.buffer[:count], self.buffer[count:]
        return data

    def receive(self):
        (length,) = struct.unpack(">I", self.receive_bytes(4))
        return pb.Envelope.FromString(self.receive_bytes(length))

    def answer_to(self, number):
        while True:
            envelope = self.receive()
            if envelope.WhichOneof("kind") == "samples":
                self.samples.append(envelope.samples)
            elif envelope.WhichOneof("kind") == "triggered":
                self.triggered.append(envelope.triggered)
            elif envelope.WhichOneof("kind") == "notice":
                self.notices.append(envelope.notice)
            elif envelope.id == number:
                return envelope
            else:
                raise AssertionError(f"an answer to nothing: {envelope}")

    def ask(self, **kind):
        return self.answer_to(self.send(**kind))

    def is_closed(self):
        """Waits for the end of the connection and ignores other messages; notices are kept."""
        try:
            while True:
                envelope = self.receive()
                if envelope.WhichOneof("kind") == "notice":
                    self.notices.append(envelope.notice)
        except Closed:
            return True
        except socket.timeout:
            return False

    # ---- shorthand of the tests ----

    def lease(self, action=pb.LeaseRequest.ACTION_ACQUIRE, axis=0):
        answer = self.ask(lease=pb.LeaseRequest(axis=axis, action=action))
        if answer.WhichOneof("kind") == "done":
            self.owner = answer.done.owner
        return answer

    def newest(self, axis=0):
        return self.ask(exchange=pb.Exchange()).exchange_reply.samples[axis].sample

    def exchange(self, tick, u_a_v=0.0, u_b_v=0.0, gates=pb.GATES_VOLTAGE, axis=0, **fields):
        command = pb.Command(axis=axis, tick=tick, gates=gates, u_a_v=u_a_v, u_b_v=u_b_v, **fields)
        return self.ask(exchange=pb.Exchange(commands=[command]))

    def step(self, tick, *voltages, **options):
        """One exchange that must succeed; returns the sample after it."""
        answer = self.exchange(tick, *voltages, **options)
        if answer.WhichOneof("kind") != "exchange_reply":
            raise AssertionError(f"tick {tick}: {answer}")
        return answer.exchange_reply.samples[0].sample

    def status(self):
        return self.ask(status_request=pb.StatusRequest()).status

    def tcp_counts(self):
        """The server's counters on TCP, by their names."""
        return {c.name: c.value for t in self.status().transports if t.name.startswith("tcp") for c in t.counts}
