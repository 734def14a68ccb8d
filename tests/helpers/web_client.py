"""A gateway process (`drivebench web`) and a small WebSocket client that can break every rule of the protocol."""
import base64
import http.client
import json
import os
import select
import socket
import ssl
import struct
import subprocess

from command_test import environment, link_of
from wire_client import PATIENCE_S, SERVER, Client, Closed

DRIVEBENCH = SERVER.parent / "drivebench"
PAGE = SERVER.parent.parent / "share/drivebench/web/index.html"
BINARY, TEXT, CLOSE, PING, PONG = 2, 1, 8, 9, 10


class Gateway:
    """Ended with the `with` block. `before` is called in its process before it becomes the program."""

    def __init__(self, server, *options, link=None, before=None):
        command = [DRIVEBENCH, "web", "--listen", "127.0.0.1:0", "--json", "--link", link or link_of(server), *options]
        self.process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, text=True, env=environment(),
                                        preexec_fn=before)
        if not select.select([self.process.stdout], [], [], PATIENCE_S)[0]:
            raise AssertionError("the gateway does not start")
        line = self.process.stdout.readline()
        if not line:
            raise AssertionError(f"the gateway ended with {self.process.wait()}")
        self.url = json.loads(line)["url"]
        self.port = int(self.url.rstrip("/").rsplit(":", 1)[1])
        self.tls = self.url.startswith("https")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()

    def raw(self, receive_buffer=None):
        plain = socket.socket()
        if receive_buffer:
            plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        plain.settimeout(PATIENCE_S)
        plain.connect(("127.0.0.1", self.port))
        if not self.tls:
            return plain
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
        return context.wrap_socket(plain)

    def get(self, path, method="GET", **headers):
        """Status, headers and body of an answer."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        connection.sock = self.raw()
        headers = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.putrequest(method, path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        body = answer.read().decode()
        connection.close()
        return answer.status, answer.headers, body

    def browser(self, hello=True, token="", receive_buffer=None, **headers):
        return Browser(self, hello, token, receive_buffer, headers)

    def memory_kib(self):
        with open(f"/proc/{self.process.pid}/status", encoding="utf-8") as status:
            return int(next(line for line in status if line.startswith("VmRSS")).split()[1])


class Refused(Exception):
    """The gateway answered the upgrade with this status."""


class Browser(Client):
    """A session with the bench in a WebSocket."""

    def __init__(self, gateway, hello, token, receive_buffer, headers, path="/bench"):
        sock = gateway.raw(receive_buffer)
        scheme = "https" if gateway.tls else "http"
        fields = {"Host": f"127.0.0.1:{gateway.port}", "Origin": f"{scheme}://127.0.0.1:{gateway.port}", "Upgrade": "websocket",
                  "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
                  "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(), **headers}
        lines = [f"GET {path} HTTP/1.1", *(f"{name}: {value}" for name, value in fields.items() if value is not None)]
        sock.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            got = sock.recv(1)
            if not got:
                break
            head += got
        status = head.split()[1].decode() if head else "closed"
        if status != "101":
            sock.close()
            raise Refused(status)
        self.close_code = None
        self.close_reason = ""
        super().__init__(sock, hello, token)

    def send_bytes(self, data):
        self.send_frame(BINARY, data)

    def send_frame(self, opcode, data, final=True, masked=True):
        size = len(data)
        head = bytes([(0x80 if final else 0) | opcode])
        mask = 0x80 if masked else 0
        if size < 126:
            head += bytes([mask | size])
        elif size < 65536:
            head += bytes([mask | 126]) + struct.pack(">H", size)
        else:
            head += bytes([mask | 127]) + struct.pack(">Q", size)
        key = b"\1\2\3\4"
        body = bytes(byte ^ key[i % 4] for i, byte in enumerate(data)) if masked else data
        self.socket.sendall(head + (key if masked else b"") + body)

    def read_exactly(self, count):
        data = b""
        while len(data) < count:
            try:
                got = self.socket.recv(count - len(data))
            except ConnectionError:
                got = b""
            if not got:
                raise Closed
            data += got
        return data

    def receive_bytes(self, count):
        """Bytes of the frames of bench.proto, which may share a message."""
        while len(self.buffer) < count:
            opcode, data = self.read_frame()
            if opcode == CLOSE:
                self.closed_by(data)
            if opcode == PING:
                self.send_frame(PONG, data)
            else:
                self.buffer += data
        data, self.buffer = self.buffer[:count], self.buffer[count:]
        return data

    def closed_by(self, data):
        if len(data) >= 2:
            (self.close_code,) = struct.unpack(">H", data[:2])
            self.close_reason = data[2:].decode()
        raise Closed

    def read_frame(self):
        first, second = self.read_exactly(2)
        size = second & 0x7F
        if size == 126:
            (size,) = struct.unpack(">H", self.read_exactly(2))
        elif size == 127:
            (size,) = struct.unpack(">Q", self.read_exactly(8))
        return first & 0x0F, self.read_exactly(size)
