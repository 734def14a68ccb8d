"""The Python package `drivebench` with the library under test; a server that it starts has the guard of the tick."""
import os
import sys

from wire_client import REPOSITORY, SERVER, guarded

PACKAGE = REPOSITORY / "clients/python"
LIBRARY = SERVER.parents[1] / "lib/libdrivebench.so"

os.environ.update(guarded({"DRIVEBENCH_LIBRARY": str(LIBRARY)}))
sys.path.insert(0, str(PACKAGE / "src"))
