"""The programs that come with the library."""
import pathlib
import shutil

from drivebench.errors import ProgramNotFound
from drivebench.library import load


def program() -> str:
    """`drivebench`, which starts the drivebench-server beside it: beside the library, as in a build tree or an
    installation, or on PATH."""
    library = pathlib.Path(load().path)  # a mere name if the system's loader has found it
    for folder in library.resolve().parents[:4] if library.is_absolute() else ():
        beside = folder / "bin" / "drivebench"
        if beside.is_file():
            return str(beside)
    found = shutil.which("drivebench")
    if found is None:
        raise ProgramNotFound("there is no program drivebench: neither beside libdrivebench nor on PATH")
    return found
