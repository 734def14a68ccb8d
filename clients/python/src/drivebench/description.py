"""What a bench says of itself, as dataclasses."""
import dataclasses
import enum

from drivebench.library import AxisStruct, DescriptionStruct, text


class Mode(enum.IntEnum):
    """How time passes."""

    REALTIME = 1
    LOCKSTEP = 2
    FREE = 3


class State(enum.IntEnum):
    """Sample.state."""

    IDLE = 0
    RUN = 1
    HOLD = 2
    TIMEOUT = 3
    FAULT = 4
    READY = 5


class Kind(enum.IntEnum):
    """Who knows a signal; a controller on a real bench has no truth."""

    STATUS = 1
    SENSOR = 2
    TRUTH = 3


class Type(enum.IntEnum):
    """The numbers of a signal: int, int or float."""

    UNSIGNED = 0
    SIGNED = 1
    REAL = 2


@dataclasses.dataclass(frozen=True)
class Signal:
    """A signal of a sample. `minimum` and `maximum` are those of the usual range; `known`: this link carries it."""

    name: str
    unit: str
    meaning: str
    kind: Kind
    type: Type
    minimum: float
    maximum: float
    known: bool


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A number of an axis. `value` is that of the opening; Bench.get() reads the one in force. `live`: Bench.set() may
    write it."""

    name: str
    unit: str
    meaning: str
    minimum: float
    maximum: float
    value: float
    integer: bool
    live: bool


@dataclasses.dataclass(frozen=True)
class Axis:
    """An emulated drive train. `phases` counts the terminals a, b, c (0: a field bus does not tell); a machine with a field
    winding has another one. `shares_amplifier_with`: the axis whose amplifier drives this machine, too; "": none."""

    name: str
    machine: str
    machine_kind: str
    connection: str
    drive_kind: str
    phases: int
    field_winding: bool
    parameters: dict[str, Parameter]
    shares_amplifier_with: str


@dataclasses.dataclass(frozen=True)
class Fault:
    """A bit of Sample.faults. `latched`: it stays until Bench.clear()."""

    bit: int
    name: str
    meaning: str
    latched: bool


@dataclasses.dataclass(frozen=True)
class Event:
    """A change that the bench file makes at a tick or on a condition."""

    axis: int
    text: str  # for example "fault open_phase = 2 when speed_rad_s > 100 for 40 ticks"


@dataclasses.dataclass(frozen=True)
class Injectable:
    """A fault for Bench.inject(); its bit stands in Sample.injected."""

    bit: int
    name: str
    unit: str
    meaning: str
    minimum: float
    maximum: float
    integer: bool


@dataclasses.dataclass(frozen=True)
class Description:
    """A bench. Signals, faults and injectable faults stand under their names, each in the bench's order.

    command_delay_ticks: 0: a command holds from the tick that it answers, 1: from the next one.
    arming_commands: accepted commands in a row that arm an axis.
    watchdog_ticks: ticks without a command until the safe action.
    """

    name: str
    mode: Mode | None  # None: a CAN bus tells it with the lease
    period_s: float
    substeps: int
    command_delay_ticks: int
    arming_commands: int
    watchdog_ticks: int
    lease_s: float
    seed: int
    configuration_hash: int
    axes: tuple[Axis, ...]
    signals: dict[str, Signal]
    faults: dict[str, Fault]
    injectables: dict[str, Injectable]
    events: tuple[Event, ...]  # empty over a link: only a bench in process tells its events

    def fault_names(self, word: int) -> list[str]:
        """The names of the bits in a fault word, as in Sample.faults."""
        return [fault.name for fault in self.faults.values() if word & fault.bit]


def _axis(row: AxisStruct) -> Axis:
    parameters = [Parameter(text(p.name), text(p.unit), text(p.meaning), p.minimum, p.maximum, p.value, bool(p.integer),
                            bool(p.live)) for p in row.parameters[:row.parameter_count]]
    return Axis(text(row.name), text(row.machine), text(row.machine_kind), text(row.connection), text(row.drive_kind),
                row.phases, bool(row.field_winding), {each.name: each for each in parameters}, text(row.shares_amplifier_with))


def description_of(d: DescriptionStruct) -> Description:
    """A copy that outlives the bench."""
    signals = [Signal(text(s.name), text(s.unit), text(s.meaning), Kind(s.kind), Type(s.type), s.minimum, s.maximum,
                      bool(s.known)) for s in d.signals[:d.signal_count]]
    faults = [Fault(f.bit, text(f.name), text(f.meaning), bool(f.latched)) for f in d.faults[:d.fault_count]]
    injectables = [Injectable(f.bit, text(f.name), text(f.unit), text(f.meaning), f.minimum, f.maximum, bool(f.integer))
                   for f in d.injectables[:d.injectable_count]]
    return Description(text(d.name), Mode(d.mode) if d.mode else None, d.period_s, d.substeps, d.command_delay_ticks,
                       d.arming_commands, d.watchdog_ticks, d.lease_s, d.seed, d.configuration_hash,
                       tuple(_axis(row) for row in d.axes[:d.axis_count]), {each.name: each for each in signals},
                       {each.name: each for each in faults}, {each.name: each for each in injectables},
                       tuple(Event(e.axis, text(e.text)) for e in d.events[:d.event_count]))
