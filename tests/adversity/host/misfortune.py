"""Starts the server with the library of misfortune.cpp."""
import ctypes
import mmap
import os
import pathlib
import struct
import sys
import tempfile


sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from wire_client import SERVER  # noqa: E402

LIBRARY = pathlib.Path(os.environ.get("DRIVEBENCH_MISFORTUNE", SERVER.parents[1] / "tests/adversity/host/libmisfortune.so"))
SYS_TGKILL = 234  # x86-64
PLACES = {"handed": (0, "<Q"), "taken": (8, "<Q"), "fail_in": (16, "<q"), "allocations": (24, "<Q"), "sleep_ms": (32, "<Q"),
          "mxcsr": (40, "<I"), "mxcsr_at_start": (44, "<I"), "syncs_fail": (48, "<Q")}


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


def thread_of(process, name):
    """The number of a thread of a process, by its name; the first one has that of the process."""
    for task in pathlib.Path(f"/proc/{process}/task").iterdir():
        if (task / "comm").read_text(encoding="utf-8").strip() == name:
            return int(task.name)
    raise AssertionError(f"there is no thread {name}")


def signal_thread(process, thread, number):
    if ctypes.CDLL(None, use_errno=True).syscall(SYS_TGKILL, process, thread, number) != 0:
        raise OSError(ctypes.get_errno(), "tgkill")
