"""What can go wrong, as exceptions: DrivebenchError and the classes below it."""
import enum


class Code(enum.IntEnum):
    """The result of a call, as drivebench.h numbers it. Positive codes are refusals of the bench."""

    OK = 0
    MALFORMED = 1
    VERSION = 2
    UNAUTHENTICATED = 3
    UNKNOWN_AXIS = 4
    UNKNOWN_SIGNAL = 5
    UNKNOWN_PARAMETER = 6
    OUT_OF_RANGE = 7
    NOT_FINITE = 8
    NOT_OWNER = 9
    OWNED = 10
    LATCHED = 11
    STALE = 12
    BUSY = 13
    READ_ONLY = 14
    WRONG_MODE = 15
    WRONG_DRIVE = 16
    UNKNOWN_FAULT = 17
    NOT_AVAILABLE = 20
    CAUSE_LASTS = 21
    FORBIDDEN = 22
    SHARED_AMPLIFIER = 23
    BAD_ARGUMENT = -1
    NO_BENCH = -2
    LINK_LOST = -3
    OTHER_ABI = -4
    FAILED = -5


class DrivebenchError(Exception):
    """Any failure. str() is the sentence.

    code: a Code, or the plain number of a code that this package does not know yet.
    field: what the sentence is about, for example "axis"; "" if nothing in particular.
    """

    code: int = Code.FAILED

    def __init__(self, sentence: str, field: str = "", code: int | None = None) -> None:
        super().__init__(sentence)
        self.field = field
        if code is not None:
            self.code = code

    @property
    def sentence(self) -> str:
        return str(self)


class Refused(DrivebenchError):
    """The bench refused the request; `code` says why, for example Code.LATCHED. Nothing has changed."""


class BadArgument(DrivebenchError, ValueError):
    """An argument is wrong; the bench was not asked."""

    code = Code.BAD_ARGUMENT


class BenchClosed(DrivebenchError):
    """The bench was closed, or was opened in the process that this one was forked from."""

    code = Code.BAD_ARGUMENT


class NoBench(DrivebenchError, ConnectionError):
    """Nothing answers at the address, or the bench file is unusable."""

    code = Code.NO_BENCH


class LinkLost(DrivebenchError, ConnectionError):
    """The link failed and is closed: open another Bench."""

    code = Code.LINK_LOST


class OtherAbi(DrivebenchError):
    """The library is of another version than this package."""

    code = Code.OTHER_ABI


class Failed(DrivebenchError):
    """The system refused something, such as memory."""


class LibraryNotFound(DrivebenchError):
    """There is no libdrivebench, or it cannot be loaded."""


class ProgramNotFound(DrivebenchError):
    """The program `drivebench` is neither beside the library nor on PATH."""


class ServerFailed(DrivebenchError):
    """drivebench-server did not start; the sentence has its own words."""


_CLASSES: dict[int, type[DrivebenchError]] = {each.code: each for each in (BadArgument, NoBench, LinkLost, OtherAbi)}


def error_of(code: int, sentence: str, field: str) -> DrivebenchError:
    """The exception for a code of the library."""
    kind: type[DrivebenchError] = _CLASSES.get(code, Refused if code > 0 else Failed)
    try:
        return kind(sentence, field, Code(code))
    except ValueError:
        return kind(sentence, field, code)
