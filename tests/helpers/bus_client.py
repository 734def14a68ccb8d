"""bus_echo, clients for it, and a network of their own for the tests of the virtual buses."""
import logging
import os
import pathlib
import socket
import subprocess
import unittest

from own_network import in_own_network

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS = pathlib.Path(os.environ.get("DRIVEBENCH_SERVER", REPOSITORY / "build/release/bin/drivebench-server")).parent
ECHO = pathlib.Path(os.environ.get("DRIVEBENCH_BUS_ECHO", PROGRAMS / "bus_echo"))

# The longest that anything may take before a test calls it a hang. No test measures time.
PATIENCE_S = 30.0
GROUP = "239.74.163.2"
BURST_REQUEST = 0x1FFFFFF0


def can_kinds(can, fd, extended=True):
    """One frame of each kind that a controller can send."""
    kinds = [
        can.Message(arbitration_id=0x123, is_extended_id=False, data=[1, 2, 0xF3]),
        can.Message(arbitration_id=0x7FE, is_extended_id=False),
        can.Message(arbitration_id=0x5, is_extended_id=False, is_remote_frame=True, dlc=4),
    ]
    if extended:
        kinds += [can.Message(arbitration_id=0x18DAF110, data=bytes(range(8))),
                  can.Message(arbitration_id=0x18DAF110, is_remote_frame=True, dlc=8)]
    if fd:
        kinds += [can.Message(arbitration_id=0x7, is_extended_id=False, is_fd=True, data=bytes(range(64)),
                              bitrate_switch=True, error_state_indicator=True),
                  can.Message(arbitration_id=0x12345, is_fd=True, data=bytes(12))]
    return kinds


class Echo:
    """A bus_echo process; ended with the `with` block."""

    def __init__(self, backend, channel, port=0):
        self.process = subprocess.Popen([str(ECHO), backend, channel, str(port)], text=True,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.name = self.process.stdout.readline().strip()
        if not self.name:
            raise RuntimeError(self.process.communicate()[1])
        self.port = int(self.name.rsplit(":", 1)[1]) if self.name.rsplit(":", 1)[1].isdigit() else 0

    def counters(self):
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return {key: int(value) for key, value in
                (pair.split("=") for pair in self.process.stdout.readline().split())}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        code = self.process.wait(PATIENCE_S)
        self.process.stdout.close()
        self.process.stderr.close()
        if code != 0:
            raise RuntimeError(f"bus_echo ended with {code}")


class Line:
    """A TCP client that reads text up to an end."""

    def __init__(self, port, buffer_bytes=None):
        self.socket = socket.socket()
        if buffer_bytes is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(("127.0.0.1", port))
        self.buffer = b""

    def send(self, text):
        self.socket.sendall(text if isinstance(text, bytes) else text.encode())

    def until(self, *ends):
        """The text up to the first of these ends, with it."""
        while True:
            found = [self.buffer.index(end) + len(end) for end in ends if end in self.buffer]
            if found:
                text, self.buffer = self.buffer[:min(found)], self.buffer[min(found):]
                return text.decode()
            more = self.socket.recv(4096)
            if not more:
                raise EOFError(self.buffer)
            self.buffer += more

    def at_end(self):
        """Reads to the end of the connection; true if it came."""
        try:
            while self.socket.recv(65536):
                pass
        except ConnectionResetError:
            pass
        return True

    def close(self):
        self.socket.close()


def run_all():
    """Runs the tests of the program; its exit code."""
    in_own_network()  # so that a bench on this computer is left alone
    try:
        import can  # noqa: F401
    except ImportError:
        print("skipped: python-can is not installed")
        return 77
    logging.disable(logging.WARNING)  # python-can's, for each element that comes in two pieces
    unittest.main()
    return 0
