"""Starts the server with the library of misfortune.cpp, and reads its recordings."""
import ctypes
import mmap
import os
import pathlib
import struct
import sys
import tempfile
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "wire"))

from wire_client import SERVER  # noqa: E402

LIBRARY = pathlib.Path(os.environ.get("DRIVEBENCH_MISFORTUNE", SERVER.parents[1] / "tests/misfortune/libmisfortune.so"))
SYS_TGKILL = 234  # x86-64
PLACES = {"handed": (0, "<Q"), "taken": (8, "<Q"), "fail_in": (16, "<q"), "allocations": (24, "<Q"), "sleep_ms": (32, "<Q"),
          "mxcsr": (40, "<I"), "mxcsr_at_start": (44, "<I")}


class Misfortune:
    """The page that test and server share; attributes are its fields."""

    def __init__(self, **fields):
        self.__dict__["file"] = tempfile.NamedTemporaryFile(prefix="drivebench-misfortune-")
        self.file.write(bytes(mmap.PAGESIZE))
        self.file.flush()
        self.__dict__["page"] = mmap.mmap(self.file.fileno(), mmap.PAGESIZE)
        for name, value in fields.items():
            setattr(self, name, value)

    def __getattr__(self, name):
        at, kind = PLACES[name]
        return struct.unpack_from(kind, self.page, at)[0]

    def __setattr__(self, name, value):
        at, kind = PLACES[name]
        struct.pack_into(kind, self.page, at, value)

    def environment(self):
        return {**os.environ, "LD_PRELOAD": str(LIBRARY), "MISFORTUNE": self.file.name}

    def enter(self):
        """For the environment of this process, which servers inherit."""
        os.environ.update({"LD_PRELOAD": str(LIBRARY), "MISFORTUNE": self.file.name})

    @staticmethod
    def leave():
        os.environ.pop("LD_PRELOAD", None)
        os.environ.pop("MISFORTUNE", None)


def thread_of(process, name):
    """The number of a thread of a process, by its name; the first one has that of the process."""
    for task in pathlib.Path(f"/proc/{process}/task").iterdir():
        if (task / "comm").read_text(encoding="utf-8").strip() == name:
            return int(task.name)
    raise AssertionError(f"there is no thread {name}")


def signal_thread(process, thread, number):
    if ctypes.CDLL(None, use_errno=True).syscall(SYS_TGKILL, process, thread, number) != 0:
        raise OSError(ctypes.get_errno(), "tgkill")


class Recording:
    """What stands in an MCAP file up to its last whole chunk; a parser of our own, so that not ours checks ours."""
    MAGIC = b"\x89MCAP0\r\n"

    def __init__(self, data):
        self.has_start = data.startswith(self.MAGIC)
        self.messages = {}  # topic -> number
        self.damaged = 0
        self.finished = data.endswith(self.MAGIC) and len(data) > 16
        self.topics = {}
        at = 8
        while at + 9 <= len(data):
            opcode, (size,) = data[at], struct.unpack_from("<Q", data, at + 1)
            if at + 9 + size > len(data):
                break
            if opcode == 0x06:
                self.chunk(data[at + 9:at + 9 + size])
            at += 9 + size
        self.tail = len(data) - at  # bytes of a record that is not whole

    def chunk(self, content):
        crc, length = struct.unpack_from("<I", content, 24)[0], struct.unpack_from("<I", content, 28)[0]
        at = 32 + length
        (size,) = struct.unpack_from("<Q", content, at)
        records = content[at + 8:at + 8 + size]
        if zlib.crc32(records) != crc:
            self.damaged += 1
            return
        at = 0
        while at < size:
            opcode, (length,) = records[at], struct.unpack_from("<Q", records, at + 1)
            if opcode == 0x04:
                channel, _, name = struct.unpack_from("<HHI", records, at + 9)
                self.topics[channel] = records[at + 17:at + 17 + name].decode()
            elif opcode == 0x05:
                topic = self.topics[struct.unpack_from("<H", records, at + 9)[0]]
                self.messages[topic] = self.messages.get(topic, 0) + 1
            at += 9 + length
