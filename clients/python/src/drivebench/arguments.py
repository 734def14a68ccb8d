"""Arguments that ctypes would wrap around, cut off or crash on, checked before the library gets them."""
import math
import operator
from typing import SupportsFloat, SupportsIndex

from drivebench.errors import BadArgument

_WORD = 1 << 64


def number(name: str, value: SupportsFloat) -> float:
    """A number; whether it is finite and in range is for the bench to judge."""
    try:
        if not isinstance(value, (str, bytes, bytearray)):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise BadArgument(f"{name} is {value!r:.80} but must be a number", name)


def whole_32(name: str, value: SupportsIndex) -> int:
    """A whole number of 32 bits."""
    number_of_64 = whole(name, value)
    if number_of_64 >= 1 << 32:
        raise BadArgument(f"{name} is {value!r:.80} but must be a whole number from 0 to 2^32 - 1", name)
    return number_of_64


def whole(name: str, value: SupportsIndex) -> int:
    """A whole number of 64 bits, such as a tick or an instant in picoseconds."""
    try:
        count = operator.index(value)
    except TypeError:
        count = -1
    if not 0 <= count < _WORD:
        raise BadArgument(f"{name} is {value!r:.80} but must be a whole number from 0 to 2^64 - 1", name)
    return count


def string(name: str, value: str) -> bytes:
    """A text for C, which ends at the first zero."""
    if not isinstance(value, str):
        raise BadArgument(f"{name} is {value!r:.80} but must be a string", name)
    try:
        encoded = value.encode("utf-8")
    except UnicodeEncodeError:
        encoded = b"\0"
    if b"\0" in encoded:
        raise BadArgument(f"{name} is {value!a:.80} but must be text without zeros", name)
    return encoded


def milliseconds(name: str, value_s: float) -> int:
    """A duration in seconds as the library takes it, rounded up."""
    seconds = number(name, value_s)
    if not 0 < seconds <= 4e6:
        raise BadArgument(f"{name} is {value_s!r:.80} but must be above 0 and at most 4e6 s", name)
    return math.ceil(seconds * 1000)
