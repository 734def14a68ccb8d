"""The bench: leases, steps, samples, changes and state."""
import ctypes
import dataclasses
import enum
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from typing import Any

from drivebench import arguments
from drivebench.description import Description, description_of
from drivebench.errors import BadArgument, Code
from drivebench.handle import Handle, Opened
from drivebench.library import ABI, MAX_EDGES, CommandStruct, EdgeStruct, OptionsStruct, Sample, load
from drivebench.recorder import Recorder

Setpoints = float | Sequence[float]
Edges = Mapping[str, Sequence[tuple[int, str]]]
_LEVELS = {"off": 1, "low": 2, "high": 3}


class _Gates(enum.IntEnum):
    OFF = 0
    VOLTAGE = 1
    ZERO = 2
    CURRENT = 3
    DUTY = 4
    EDGES = 5


@dataclasses.dataclass(frozen=True)
class Command:
    """What a controller asks of an axis for a tick: one of the six.

    voltages: at the terminals a, b, c [V], one number for each that the machine has; in a star against the middle of
        the DC link.
    currents: the same in [A], for a drive of kind "current_amplifier".
    duties: of a leg of a star its mean voltage against the negative rail over the link's, 0 to 1; of a winding between
        two legs its voltage over the link's, -1 to 1.
    edges: of a switched inverter, for each leg by its letter a list of (offset in ns within the tick, "low", "high" or
        "off"), offsets rising: {"a": [(0, "low"), (9000, "high")]}. A leg without a list is off.
    short: all terminals connected, an active short circuit.
    off: gates off; currents flow through the diodes until they are zero.
    field: of the field winding, [V], [A] or a duty like the others.
    legs_off: letters of the legs that are on their diodes, whatever the others do: "c" floats phase c.
    """

    voltages: Setpoints | None = None
    currents: Setpoints | None = None
    duties: Setpoints | None = None
    edges: Edges | None = None
    short: bool = False
    off: bool = False
    field: float = 0.0
    legs_off: str = ""


OFF = Command(off=True)
SHORT = Command(short=True)


class Bench(Opened):
    """An open bench; a context manager, which closes it.

    address: "inproc:BENCH" (in this process: a bench file, or the name of one that came with drivebench),
        "tcp:HOST:PORT", "tls:HOST:PORT?ca=FILE&certificate=FILE&key=FILE", "unix:PATH", "shm:PATH" (the unix socket
        of the bench, and memory that both share), "can:BACKEND:CHANNEL?node=N", "modbus:HOST:PORT?unit=N". The samples
        are the same, bit for bit, but over can and modbus, which round.
    token: of the bench; None: the environment variable DRIVEBENCH_TOKEN, if it is set.
    deadline_s: [s] for connecting and for each answer.
    clear: acquire() clears what a controller before has left latched.
    conducts: set(), set_load(), inject() and bump() also change axes that other sessions hold: over tcp, tls, unix
        and shm, with the role conductor.

    Every method raises DrivebenchError. `axis` is a number or a name. Several threads may call: they take turns.
    """

    def __init__(self, address: str, token: str | None = None, deadline_s: float = 5.0, clear: bool = False,
                 conducts: bool = False) -> None:
        library = load()
        options = OptionsStruct(token=None if token is None else arguments.string("token", token), client=b"drivebench-python",
                                deadline_ms=arguments.milliseconds("deadline_s", deadline_s), clear_on_acquire=bool(clear),
                                conducts=bool(conducts))
        pointer = ctypes.c_void_p()
        code = library.open_abi(arguments.string("address", address), options, ABI, library.sample_size, ctypes.byref(pointer))
        if code != Code.OK:
            raise library.error_for(code, None)
        super().__init__(address, Handle(pointer, library.close, library.error_for, "bench"))
        self._library = library
        self._description_struct = library.describe(pointer).contents
        self._sample_type = library.sample_type(self._description_struct)
        self._description = description_of(self._description_struct)
        axes = self._description.axes
        self._numbers: dict[int | str, int] = {axis.name: number for number, axis in enumerate(axes)}
        self._numbers.update((number, number) for number in range(len(axes)))
        self._ticks: dict[int, int] = {}  # by axis: of the newest sample that a call has returned
        self._recorders: list[Recorder] = []

    def describe(self) -> Description:
        """The bench with its axes, parameters, signals and faults."""
        return self._description

    def acquire(self, axis: int | str = 0) -> None:
        """Acquires the lease of an axis: only its holder may command, change and clear."""
        with self._handle.lock:
            number = self._number(axis)
            self._call("acquire", number)
            self._ticks.pop(number, None)  # another controller may have gone on from there
            self._description = description_of(self._description_struct)  # a CAN bus tells its mode with the lease

    def renew(self, axis: int | str = 0) -> None:
        """Keeps a lease without a command."""
        self._call("renew", self._number(axis))

    def release(self, axis: int | str = 0) -> None:
        """Gives the lease back; the axis goes into its safe action."""
        self._call("release", self._number(axis))

    def clear(self, axis: int | str = 0) -> None:
        """Clears the latched faults of an axis."""
        self._call("clear", self._number(axis))

    def step(self, axis: int | str = 0, *, voltages: Setpoints | None = None, currents: Setpoints | None = None,
             duties: Setpoints | None = None, edges: Edges | None = None, short: bool = False, off: bool = False,
             field: float = 0.0, legs_off: str = "", tick: int | None = None) -> Sample:
        """Gives the bench a command for one axis and returns the next sample.

        The keywords are those of Command; exactly one of the first six is given. The command answers the sample that
        step(), newest() or run() returned last, or that of `tick`. In lockstep the tick runs when every axis that a
        controller holds has its command: several axes take step_all().
        """
        number = self._number(axis)
        sample = self._sample_type()
        handle = self._handle
        with handle.lock:
            command = self._command(number, tick, Command(voltages, currents, duties, edges, short, off, field, legs_off))
            code = self._library.step(handle.pointer, command, 1, ctypes.byref(sample))
            if code:
                handle.fail(code)
            self._keep(number, sample)
        return sample

    def step_all(self, commands: Mapping[int | str, Command]) -> dict[int | str, Sample]:
        """Gives the bench a command for each of several axes and returns the next samples under the same keys. If one
        command is refused, none is taken."""
        with self._handle.lock:
            numbers = [self._number(axis) for axis in commands]
            rows = [self._command(number, None, c) for number, c in zip(numbers, map(_checked, commands.values()))]
            samples = (self._sample_type * len(rows))()
            code = self._library.step(self._handle.pointer, (CommandStruct * len(rows))(*rows), len(rows), samples)
            if code:
                self._handle.fail(code)
            for number, sample in zip(numbers, samples):
                self._keep(number, sample)
        return dict(zip(commands, samples))

    def run(self, controller: Callable[[Sample], Command], ticks: int, axis: int | str = 0) -> Sample:
        """Runs a controller for so many ticks: it gets each sample, at first the newest, and returns the command that
        answers it. Returns the last sample."""
        sample = self.newest(axis)
        for _ in range(arguments.whole("ticks", ticks)):
            c = _checked(controller(sample))
            sample = self.step(axis, voltages=c.voltages, currents=c.currents, duties=c.duties, edges=c.edges, short=c.short,
                               off=c.off, field=c.field, legs_off=c.legs_off, tick=sample.tick)
        return sample

    def newest(self, axis: int | str = 0) -> Sample:
        """The newest sample of an axis, without waiting."""
        number = self._number(axis)
        sample = self._sample_type()
        with self._handle.lock:
            self._call("newest", number, ctypes.byref(sample))
            self._keep(number, sample)
        return sample

    def record(self, signals: Iterable[str], axis: int | str = 0) -> Recorder:
        """Keeps these signals of every sample of an axis that a call returns from now on; see Recorder."""
        recorder = Recorder(self._description, list(signals), self._number(axis), self._recorders.remove)
        self._recorders.append(recorder)
        return recorder

    def get(self, name: str, axis: int | str = 0) -> float:
        """Reads a parameter, in the unit of its description."""
        value = ctypes.c_double()
        self._call("get", self._number(axis), arguments.string("name", name), ctypes.byref(value))
        return value.value

    def set(self, name: str, value: float, axis: int | str = 0, *, ramp_ticks: int = 0, at_tick: int = 0) -> None:
        """Writes a parameter: at once (at_tick 0) or at a tick, as a step (ramp_ticks 0) or in a ramp."""
        self._call("set", self._number(axis), arguments.string("name", name), arguments.number("value", value),
                   arguments.whole("ramp_ticks", ramp_ticks), arguments.whole("at_tick", at_tick))

    def set_load(self, load_nm: float, axis: int | str = 0, *, ramp_ticks: int = 0, at_tick: int = 0) -> None:
        """Changes the load torque [N*m]; positive opposes a positive torque of the machine."""
        self._call("set_load", self._number(axis), arguments.number("load_nm", load_nm),
                   arguments.whole("ramp_ticks", ramp_ticks), arguments.whole("at_tick", at_tick))

    def inject(self, name: str, value: float, axis: int | str = 0, *, at_tick: int = 0) -> None:
        """Puts one of describe().injectables into an axis; a value of 0 takes it away."""
        self._call("inject", self._number(axis), arguments.string("name", name), arguments.number("value", value),
                   arguments.whole("at_tick", at_tick))

    def bump(self, impulse_nms: float, axis: int | str = 0, *, at_tick: int = 0) -> None:
        """Bumps the shaft with an angular impulse [N*m*s], positive like a torque of the machine."""
        self._call("bump", self._number(axis), arguments.number("impulse_nms", impulse_nms),
                   arguments.whole("at_tick", at_tick))

    def event_tick(self, event: int) -> int | None:
        """The tick in which one of describe().events acted; None: not yet. In process only."""
        tick = ctypes.c_int64()
        self._call("event_tick", arguments.whole("event", event), ctypes.byref(tick))
        return tick.value if tick.value >= 0 else None

    def state_hash(self) -> int:
        """The hash of the state and of all samples so far: equal hashes mean equal runs. Lockstep only."""
        value = ctypes.c_uint64()
        self._call("state_hash", ctypes.byref(value))
        return value.value

    def reset(self) -> None:
        """Back to tick 0, without any changes; leases stay. In process and over tcp, tls, unix and shm."""
        with self._handle.lock:
            self._call("reset")
            self._ticks.clear()

    def save(self) -> bytes:
        """The whole state: machines, sensors, noise, commands, scheduled changes."""
        with self._handle.lock:
            size = ctypes.c_size_t()
            self._call("save", None, ctypes.byref(size))
            state = ctypes.create_string_buffer(size.value)
            self._call("save", state, ctypes.byref(size))
        return state.raw

    def restore(self, state: bytes) -> None:
        """Goes on from a saved state of the same bench, of this process, another one or a server.

        Leases stay with their holders: acquire an axis that the state drives before you restore it.
        """
        if not isinstance(state, bytes):
            raise BadArgument(f"state is of type {type(state).__name__} but must be bytes from save()", "state")
        with self._handle.lock:
            self._call("restore", state, len(state))
            self._ticks.clear()

    def _call(self, name: str, *values: Any) -> None:
        with self._handle.lock:
            code = getattr(self._library, name)(self._handle.pointer, *values)
            if code:
                self._handle.fail(code)

    def _number(self, axis: int | str) -> int:
        try:
            return self._numbers[axis]
        except (KeyError, TypeError):
            there = ", ".join(f"{number} {each.name}".rstrip() for number, each in enumerate(self._description.axes))
            raise BadArgument(f"axis {axis!r:.80} does not exist; the bench has {there}", "axis") from None

    def _keep(self, number: int, sample: Sample) -> None:
        self._ticks[number] = sample.tick
        for recorder in self._recorders:
            recorder.add(number, sample)

    def _command(self, number: int, tick: int | None, c: Command) -> CommandStruct:
        given = {"voltages": (_Gates.VOLTAGE, c.voltages), "currents": (_Gates.CURRENT, c.currents),
                 "duties": (_Gates.DUTY, c.duties)}
        setpoints = [(name, gates, values) for name, (gates, values) in given.items() if values is not None]
        if len(setpoints) + (c.edges is not None) + bool(c.short) + bool(c.off) != 1:
            raise BadArgument("a command has exactly one of voltages, currents, duties, edges, short and off")
        if tick is None:
            tick = self._ticks[number] if number in self._ticks else self.newest(number).tick
        else:
            tick = arguments.whole("tick", tick)
        legs_off = _legs(c.legs_off) if c.legs_off else 0
        for name, gates, values in setpoints:
            return CommandStruct(number, gates, tick, *self._setpoints(name, number, values, c.field), legs_off)
        if c.edges is not None:
            return CommandStruct(number, _Gates.EDGES, tick, setpoint_f=arguments.number("field", c.field), legs_off=legs_off,
                                 edges=_edges(c.edges))
        return CommandStruct(number, _Gates.ZERO if c.short else _Gates.OFF, tick, legs_off=legs_off)

    def _setpoints(self, name: str, number: int, values: Setpoints, field: float) -> tuple[float, float, float, float]:
        each = tuple(values) if isinstance(values, Sized) and not isinstance(values, (str, bytes)) else (values,)
        terminals = self._description.axes[number].phases
        if len(each) not in ((terminals,) if terminals else (1, 2, 3)):
            rule = f"needs {terminals}" if terminals else "needs 1 to 3"
            raise BadArgument(f"{name} is {values!r:.80} but axis {number} {rule}, one for each terminal", name)
        a, b, c = (tuple(arguments.number(name, value) for value in each) + (0.0, 0.0))[:3]
        return a, b, c, arguments.number("field", field)


def _legs(letters: str) -> int:
    if not isinstance(letters, str) or not set(letters) <= set("abc"):
        raise BadArgument(f"legs_off is {letters!r:.80} but must name legs by their letters, such as \"c\" or \"ab\"", "legs_off")
    return sum(1 << "abc".index(letter) for letter in set(letters))


def _edges(edges: Edges) -> Any:
    """The edges of three legs as the library has them; it judges their order."""
    rows = (EdgeStruct * MAX_EDGES * 3)()
    if not isinstance(edges, Mapping) or not set(edges) <= set("abc"):
        raise BadArgument(f"edges is {edges!r:.80} but must be a mapping from the letters of legs, a to c, to lists", "edges")
    for letter, each in edges.items():
        if len(each) > MAX_EDGES:
            raise BadArgument(f"leg {letter} has {len(each)} edges but may have {MAX_EDGES}", "edges")
        for n, (offset_ns, level) in enumerate(each):
            if level not in _LEVELS:
                raise BadArgument(f"a level of leg {letter} is {level!r:.80} but must be \"off\", \"low\" or \"high\"", "edges")
            rows["abc".index(letter)][n] = EdgeStruct(arguments.whole_32("offset_ns", offset_ns), _LEVELS[level])
    return rows


def _checked(command: Command) -> Command:
    if not isinstance(command, Command):
        raise BadArgument(f"the command is {command!r:.80} but must be a drivebench.Command", "command")
    return command
