"""The gate level: the power stage of a bench in this process or in a server beside it, its legs set at any picosecond."""
import ctypes
import enum
from typing import Any, NamedTuple

from drivebench import arguments
from drivebench.errors import BadArgument, Code
from drivebench.handle import Handle, Opened
from drivebench.library import ABI, BridgeEdgeStruct, BridgeMeansStruct, BridgeStateStruct, LegStruct, load


class LegMode(enum.IntEnum):
    """What a leg does: with the modes of PWM, for `compare_ps` of each period."""

    OPEN = 0
    LOW = 1
    HIGH = 2
    PWM = 3
    PWM_HIGH = 4
    PWM_LOW = 5


class EdgeKind(enum.IntEnum):
    """The kind of an edge that run() returns."""

    COMPARATOR = 1
    HALL = 2
    CURRENT_ZERO = 3
    BREAK = 4


class BridgeEdge(NamedTuple):
    """An event of a bridge. channel: 0 for terminal a or Hall line 1. level: 0 or 1, after it."""

    at_ps: int
    kind: EdgeKind
    channel: int
    level: int


class Bridge(Opened):
    """An axis of "inproc:BENCH", or of the server at "shm:PATH", at gate level; a context manager, which closes it.

    The drive is of kind "switched_inverter", and all legs are open at first. Times are in picoseconds since the
    opening. Every method raises DrivebenchError, and after a refusal nothing has changed. Several threads may call:
    they take turns.
    """

    def __init__(self, address: str, axis: int = 0) -> None:
        library = load()
        pointer = ctypes.c_void_p()
        code = library.bridge_open_abi(arguments.string("address", address), arguments.whole_32("axis", axis), ABI,
                                       ctypes.sizeof(BridgeStateStruct), ctypes.sizeof(BridgeMeansStruct), ctypes.byref(pointer))
        if code != Code.OK:
            raise library.bridge_error_for(code, None)
        self._library = library
        super().__init__(address, Handle(pointer, library.bridge_close, library.bridge_error_for, "bridge"))

    def set(self, leg: int | str, mode: LegMode, *, period_ps: int = 0, compare_ps: int = 0, dead_ps: int = 0,
            period_start_ps: int = 0, centred: bool = False) -> None:
        """Sets a leg, by its letter or its number, from now on: legs that are set one after the other change together."""
        setting = LegStruct(arguments.whole_32("mode", mode), bool(centred),
                            arguments.whole("period_start_ps", period_start_ps), arguments.whole("period_ps", period_ps),
                            arguments.whole("compare_ps", compare_ps), arguments.whole("dead_ps", dead_ps))
        self._call("set", _number_of(leg), ctypes.byref(setting))

    def run(self, until_ps: int, room: int = 0) -> list[BridgeEdge]:
        """Runs to `until_ps` and returns the edges up to there. It ends early at the edge that fills `room`, so that 1
        goes to the next event; with 0 edges are left out."""
        edges = (BridgeEdgeStruct * arguments.whole_32("room", room))()
        count = ctypes.c_size_t()
        self._call("run", arguments.whole("until_ps", until_ps), edges, len(edges), ctypes.byref(count), None)
        return [_edge(each) for each in edges[:count.value]]

    def next_edge(self, limit_ps: int) -> BridgeEdge | None:
        """The first edge up to `limit_ps` if nothing is set before; None: there is none. Time stays."""
        edge = BridgeEdgeStruct()
        found = ctypes.c_int32()
        self._call("next_edge", arguments.whole("limit_ps", limit_ps), ctypes.byref(edge), ctypes.byref(found))
        return _edge(edge) if found.value else None

    def read(self) -> BridgeStateStruct:
        """The state at this instant, as attributes: now_ps, current_a[0], terminal_v[0], speed_rad_s, ..."""
        state = BridgeStateStruct()
        self._call("read", ctypes.byref(state))
        return state

    def mark(self) -> None:
        """mean() counts from now on."""
        self._call("mark")

    def mean(self) -> BridgeMeansStruct:
        """Mean values and energies since the mark, as attributes: time_s, current_a[0], torque_nm, link_j, ..."""
        means = BridgeMeansStruct()
        self._call("mean", ctypes.byref(means))
        return means

    def set_load(self, load_nm: float) -> None:
        """The load torque [N*m] from now on; positive opposes a positive torque of the machine."""
        self._call("set_load", arguments.number("load_nm", load_nm))

    def get_parameter(self, name: str) -> float:
        """Reads a parameter, in the unit of its description."""
        value = ctypes.c_double()
        self._call("get_parameter", arguments.string("name", name), ctypes.byref(value))
        return value.value

    def set_parameter(self, name: str, value: float) -> None:
        """Writes a live parameter, from now on."""
        self._call("set_parameter", arguments.string("name", name), arguments.number("value", value))

    def inject(self, name: str, value: float) -> None:
        """Puts a fault in force; a value of 0 takes it away."""
        self._call("inject", arguments.string("name", name), arguments.number("value", value))

    def clear(self) -> None:
        """Clears latched faults."""
        self._call("clear")

    def save(self) -> bytes:
        """The whole state, with the live parameters."""
        with self._handle.lock:
            size = ctypes.c_size_t()
            self._call("save", None, ctypes.byref(size))
            state = ctypes.create_string_buffer(size.value)
            self._call("save", state, ctypes.byref(size))
        return state.raw

    def restore(self, state: bytes) -> None:
        """Goes on from a saved state of the same bench file, axis and build."""
        if not isinstance(state, bytes):
            raise BadArgument(f"state is of type {type(state).__name__} but must be bytes from save()", "state")
        self._call("restore", state, len(state))

    def _call(self, name: str, *values: Any) -> None:
        with self._handle.lock:
            code = getattr(self._library, "bridge_" + name)(self._handle.pointer, *values)
            if code:
                self._handle.fail(code)


def _number_of(leg: int | str) -> int:
    if not isinstance(leg, str):
        return arguments.whole_32("leg", leg)
    if leg not in tuple("abc"):
        raise BadArgument(f"leg is {leg!r:.80} but must be a, b, c or its number", "leg")
    return "abc".index(leg)


def _edge(edge: BridgeEdgeStruct) -> BridgeEdge:
    return BridgeEdge(edge.at_ps, EdgeKind(edge.kind), edge.channel, edge.level)
