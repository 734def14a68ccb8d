"""libdrivebench, found and declared: the structs and calls of drivebench.h and drivebench_bridge.h, through ctypes.

The signals of a sample are not listed here: the library describes them, and Sample is made from that.
"""
import ctypes
import functools
import os
import pathlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from drivebench.errors import Code, DrivebenchError, LibraryNotFound, OtherAbi, error_of

ABI = 1
SIGNAL_BYTES = 8


MAX_EDGES = 8


class EdgeStruct(ctypes.Structure):
    _fields_ = [("offset_ns", ctypes.c_uint32), ("level", ctypes.c_uint32)]


class CommandStruct(ctypes.Structure):
    _fields_ = [("axis", ctypes.c_uint32), ("gates", ctypes.c_uint32), ("tick", ctypes.c_uint64),
                ("setpoint_a", ctypes.c_double), ("setpoint_b", ctypes.c_double), ("setpoint_c", ctypes.c_double),
                ("setpoint_f", ctypes.c_double), ("legs_off", ctypes.c_uint64),
                ("edges", EdgeStruct * MAX_EDGES * 3)]


class SignalStruct(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("unit", ctypes.c_char_p), ("meaning", ctypes.c_char_p), ("kind", ctypes.c_int32),
                ("type", ctypes.c_int32), ("minimum", ctypes.c_double), ("maximum", ctypes.c_double),
                ("known", ctypes.c_int32)]


class ParameterStruct(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("unit", ctypes.c_char_p), ("meaning", ctypes.c_char_p),
                ("minimum", ctypes.c_double), ("maximum", ctypes.c_double), ("value", ctypes.c_double),
                ("integer", ctypes.c_int32), ("live", ctypes.c_int32)]


class AxisStruct(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("machine", ctypes.c_char_p), ("machine_kind", ctypes.c_char_p),
                ("connection", ctypes.c_char_p), ("drive_kind", ctypes.c_char_p), ("phases", ctypes.c_uint32),
                ("field_winding", ctypes.c_int32), ("parameter_count", ctypes.c_size_t),
                ("parameters", ctypes.POINTER(ParameterStruct)), ("shares_amplifier_with", ctypes.c_char_p)]


class FaultStruct(ctypes.Structure):
    _fields_ = [("bit", ctypes.c_uint64), ("name", ctypes.c_char_p), ("meaning", ctypes.c_char_p), ("latched", ctypes.c_int32)]


class InjectableStruct(ctypes.Structure):
    _fields_ = [("bit", ctypes.c_uint64), ("name", ctypes.c_char_p), ("unit", ctypes.c_char_p), ("meaning", ctypes.c_char_p),
                ("minimum", ctypes.c_double), ("maximum", ctypes.c_double), ("integer", ctypes.c_int32)]


class EventStruct(ctypes.Structure):
    _fields_ = [("axis", ctypes.c_uint32), ("text", ctypes.c_char_p)]


class DescriptionStruct(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("mode", ctypes.c_int32), ("period_s", ctypes.c_double),
                ("substeps", ctypes.c_uint32), ("command_delay_ticks", ctypes.c_uint32), ("arming_commands", ctypes.c_uint32),
                ("watchdog_ticks", ctypes.c_uint32), ("lease_s", ctypes.c_double), ("seed", ctypes.c_uint64),
                ("configuration_hash", ctypes.c_uint64), ("axis_count", ctypes.c_size_t),
                ("axes", ctypes.POINTER(AxisStruct)), ("signal_count", ctypes.c_size_t),
                ("signals", ctypes.POINTER(SignalStruct)), ("fault_count", ctypes.c_size_t),
                ("faults", ctypes.POINTER(FaultStruct)), ("injectable_count", ctypes.c_size_t),
                ("injectables", ctypes.POINTER(InjectableStruct)), ("event_count", ctypes.c_size_t),
                ("events", ctypes.POINTER(EventStruct))]


class OptionsStruct(ctypes.Structure):
    _fields_ = [("token", ctypes.c_char_p), ("client", ctypes.c_char_p), ("deadline_ms", ctypes.c_uint32),
                ("clear_on_acquire", ctypes.c_int32), ("conducts", ctypes.c_int32)]


class LegStruct(ctypes.Structure):
    _fields_ = [("mode", ctypes.c_uint32), ("centred", ctypes.c_uint32), ("period_start_ps", ctypes.c_uint64),
                ("period_ps", ctypes.c_uint64), ("compare_ps", ctypes.c_uint64), ("dead_ps", ctypes.c_uint64)]


class BridgeEdgeStruct(ctypes.Structure):
    _fields_ = [("at_ps", ctypes.c_uint64), ("kind", ctypes.c_uint32), ("channel", ctypes.c_uint32), ("level", ctypes.c_uint32),
                ("reserved", ctypes.c_uint32)]


class BridgeStateStruct(ctypes.Structure):
    _fields_ = [("now_ps", ctypes.c_uint64), ("current_a", ctypes.c_double * 3), ("terminal_v", ctypes.c_double * 3),
                ("bus_v", ctypes.c_double), ("angle_rad", ctypes.c_double), ("speed_rad_s", ctypes.c_double),
                ("torque_nm", ctypes.c_double), ("load_nm", ctypes.c_double), ("magnetic_j", ctypes.c_double),
                ("comparator_v", ctypes.c_double * 3), ("comparator_levels", ctypes.c_uint64), ("hall_lines", ctypes.c_uint64),
                ("encoder_count", ctypes.c_int64), ("legs", ctypes.c_uint64), ("faults", ctypes.c_uint64),
                ("lost_edges", ctypes.c_uint64)]


class BridgeMeansStruct(ctypes.Structure):
    _fields_ = [("since_ps", ctypes.c_uint64), ("time_s", ctypes.c_double), ("current_a", ctypes.c_double * 3),
                ("terminal_v", ctypes.c_double * 3), ("bus_v", ctypes.c_double), ("link_a", ctypes.c_double),
                ("torque_nm", ctypes.c_double), ("speed_rad_s", ctypes.c_double), ("link_j", ctypes.c_double),
                ("electrical_j", ctypes.c_double), ("copper_j", ctypes.c_double), ("shaft_j", ctypes.c_double)]


_BENCH = ctypes.c_void_p
_BRIDGE = ctypes.c_void_p
_AXIS = ctypes.c_uint32
_TICKS = ctypes.c_uint64

# The calls that give a code, with their arguments.
_CALLS: dict[str, tuple[Any, ...]] = {
    "open_abi": (ctypes.c_char_p, ctypes.POINTER(OptionsStruct), ctypes.c_uint32, ctypes.c_size_t, ctypes.POINTER(_BENCH)),
    "acquire": (_BENCH, _AXIS),
    "renew": (_BENCH, _AXIS),
    "release": (_BENCH, _AXIS),
    "clear": (_BENCH, _AXIS),
    "step": (_BENCH, ctypes.POINTER(CommandStruct), ctypes.c_size_t, ctypes.c_void_p),
    "newest": (_BENCH, _AXIS, ctypes.c_void_p),
    "get": (_BENCH, _AXIS, ctypes.c_char_p, ctypes.POINTER(ctypes.c_double)),
    "set": (_BENCH, _AXIS, ctypes.c_char_p, ctypes.c_double, _TICKS, _TICKS),
    "set_load": (_BENCH, _AXIS, ctypes.c_double, _TICKS, _TICKS),
    "inject": (_BENCH, _AXIS, ctypes.c_char_p, ctypes.c_double, _TICKS),
    "bump": (_BENCH, _AXIS, ctypes.c_double, _TICKS),
    "event_tick": (_BENCH, ctypes.c_size_t, ctypes.POINTER(ctypes.c_int64)),
    "state_hash": (_BENCH, ctypes.POINTER(ctypes.c_uint64)),
    "reset": (_BENCH,),
    "save": (_BENCH, ctypes.c_void_p, ctypes.POINTER(ctypes.c_size_t)),
    "restore": (_BENCH, ctypes.c_char_p, ctypes.c_size_t),
    "bridge_open_abi": (ctypes.c_char_p, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_size_t, ctypes.c_size_t,
                        ctypes.POINTER(_BRIDGE)),
    "bridge_set": (_BRIDGE, ctypes.c_uint32, ctypes.POINTER(LegStruct)),
    "bridge_run": (_BRIDGE, ctypes.c_uint64, ctypes.POINTER(BridgeEdgeStruct), ctypes.c_size_t, ctypes.POINTER(ctypes.c_size_t),
                   ctypes.POINTER(ctypes.c_uint64)),
    "bridge_next_edge": (_BRIDGE, ctypes.c_uint64, ctypes.POINTER(BridgeEdgeStruct), ctypes.POINTER(ctypes.c_int32)),
    "bridge_read": (_BRIDGE, ctypes.POINTER(BridgeStateStruct)),
    "bridge_mark": (_BRIDGE,),
    "bridge_mean": (_BRIDGE, ctypes.POINTER(BridgeMeansStruct)),
    "bridge_set_load": (_BRIDGE, ctypes.c_double),
    "bridge_get_parameter": (_BRIDGE, ctypes.c_char_p, ctypes.POINTER(ctypes.c_double)),
    "bridge_set_parameter": (_BRIDGE, ctypes.c_char_p, ctypes.c_double),
    "bridge_inject": (_BRIDGE, ctypes.c_char_p, ctypes.c_double),
    "bridge_clear": (_BRIDGE,),
    "bridge_save": (_BRIDGE, ctypes.c_void_p, ctypes.POINTER(ctypes.c_size_t)),
    "bridge_restore": (_BRIDGE, ctypes.c_char_p, ctypes.c_size_t),
}
# The calls that give something else.
_OTHERS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "close": (None, (_BENCH,)),
    "error": (ctypes.c_char_p, (_BENCH,)),
    "error_field": (ctypes.c_char_p, (_BENCH,)),
    "describe": (ctypes.POINTER(DescriptionStruct), (_BENCH,)),
    "version": (ctypes.c_char_p, ()),
    "bridge_close": (None, (_BRIDGE,)),
    "bridge_error": (ctypes.c_char_p, (_BRIDGE,)),
}


def text(value: bytes | None) -> str:
    """A string of the library; a null pointer is ""."""
    return (value or b"").decode("utf-8", "replace")


class Sample(ctypes.Structure):
    """The signals of an axis at the start of a tick, as attributes: sample.speed_rad_s, sample.encoder_count, ...

    Bench.describe().signals has the names with unit and meaning. An unsigned or signed signal is an int, a real one a
    float. A signal that the link does not carry is as before tick 0. Two samples are equal if all their bits are.
    """

    __slots__ = ()

    if TYPE_CHECKING:
        def __getattr__(self, name: str) -> Any: ...

    def as_dict(self) -> dict[str, float]:
        """All signals by name."""
        return {field[0]: getattr(self, field[0]) for field in self._fields_}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sample) and bytes(self) == bytes(other)

    __hash__ = None  # type: ignore[assignment]

    def __copy__(self) -> "Sample":
        return type(self).from_buffer_copy(self)

    def __deepcopy__(self, memo: object) -> "Sample":
        return self.__copy__()

    def __repr__(self) -> str:
        return "Sample(" + ", ".join(f"{name}={value!r}" for name, value in self.as_dict().items()) + ")"


_SIGNAL_TYPES = (ctypes.c_uint64, ctypes.c_int64, ctypes.c_double)  # a drivebench_type


class Library:
    """The calls by the names of drivebench.h without `drivebench_`."""

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            self._dll = ctypes.CDLL(path)
            for name, arguments in _CALLS.items():
                self._declare(name, ctypes.c_int, arguments)
            for name, (result, arguments) in _OTHERS.items():
                self._declare(name, result, arguments)
        except OSError as error:
            raise LibraryNotFound(f"libdrivebench cannot be loaded: {error}") from error
        except AttributeError as error:
            raise OtherAbi(f"{path} is no libdrivebench of ABI {ABI}: {error}") from error
        self.sample_size = self._sample_size()
        self._sample_type: type[Sample] | None = None

    if TYPE_CHECKING:
        def __getattr__(self, name: str) -> Callable[..., Any]: ...

    def _declare(self, name: str, result: Any, arguments: tuple[Any, ...]) -> None:
        call = getattr(self._dll, "drivebench_" + name)
        call.restype, call.argtypes = result, arguments
        setattr(self, name, call)

    def _sample_size(self) -> int:
        """The size of this library's sample, which a C program has from its header: the largest that the library does
        not refuse as another's. The address is empty, so that nothing is opened."""
        low, high = 0, 4096  # [signals]
        while high - low > 1:
            middle = (low + high) // 2
            code = self.open_abi(b"", None, ABI, middle * SIGNAL_BYTES, ctypes.byref(_BENCH()))
            low, high = (low, middle) if code == Code.OTHER_ABI else (middle, high)
        return low * SIGNAL_BYTES

    def sample_type(self, description: DescriptionStruct) -> type[Sample]:
        """The struct of the signals that the library describes: the same for each of its benches."""
        if self._sample_type is None:
            rows = description.signals[:description.signal_count]
            fields = [(text(row.name), _SIGNAL_TYPES[row.type]) for row in rows]
            made = type("Sample", (Sample,), {"__slots__": (), "_fields_": fields, "__doc__": Sample.__doc__})
            if ctypes.sizeof(made) != self.sample_size:
                raise OtherAbi(f"the library describes {len(fields)} signals but its sample has {self.sample_size} bytes")
            self._sample_type = made
        return self._sample_type

    def error_for(self, code: int, bench: Any) -> DrivebenchError:
        """The exception for what the last call on the bench gave; None: for the last open."""
        return error_of(code, text(self.error(bench)), text(self.error_field(bench)))

    def bridge_error_for(self, code: int, bridge: Any) -> DrivebenchError:
        """The same for a bridge."""
        return error_of(code, text(self.bridge_error(bridge)), "")


def _places() -> Iterator[str]:
    for folder in pathlib.Path(__file__).resolve().parents:
        for preset in ("release", "dev"):
            built = folder / "build" / preset / "lib" / "libdrivebench.so"
            if built.is_file():
                yield str(built)
    yield f"libdrivebench.so.{ABI}"


@functools.cache
def load() -> Library:
    """The library: of DRIVEBENCH_LIBRARY, of a build tree above this package, or of the system's loader."""
    chosen = os.environ.get("DRIVEBENCH_LIBRARY")
    try:
        return Library(chosen or next(_places()))
    except LibraryNotFound as error:
        raise LibraryNotFound(f"{error}; DRIVEBENCH_LIBRARY names the file, or install drivebench, or build it with ./bench tools") from error


def version() -> str:
    """The version of libdrivebench, for example "0.1.0"."""
    return text(load().version())
