"""The structs, codes and calls of the package `drivebench` are those of drivebench.h and drivebench_bridge.h."""
import copy
import ctypes
import ctypes.util
import pathlib
import re
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402
from wire_client import REPOSITORY  # noqa: E402

import drivebench  # noqa: E402
from drivebench import bench, library  # noqa: E402

HEADER = "".join(re.sub(r"/\*.*?\*/", "", (REPOSITORY / "protocols/abi" / name).read_text(encoding="utf-8"), flags=re.DOTALL)
                 for name in ("drivebench.h", "drivebench_bridge.h"))
TYPES = {"uint32_t": ctypes.c_uint32, "int32_t": ctypes.c_int32, "uint64_t": ctypes.c_uint64, "int64_t": ctypes.c_int64,
         "double": ctypes.c_double, "size_t": ctypes.c_size_t, "const char*": ctypes.c_char_p,
         "const drivebench_parameter*": ctypes.POINTER(library.ParameterStruct),
         "const drivebench_axis*": ctypes.POINTER(library.AxisStruct),
         "const drivebench_signal*": ctypes.POINTER(library.SignalStruct),
         "const drivebench_fault*": ctypes.POINTER(library.FaultStruct),
         "const drivebench_injectable*": ctypes.POINTER(library.InjectableStruct),
         "int64_t*": ctypes.POINTER(ctypes.c_int64),
         "drivebench_edge": library.EdgeStruct,
         "const drivebench_event*": ctypes.POINTER(library.EventStruct),
         "int": ctypes.c_int, "void": None, "const drivebench_description*": ctypes.POINTER(library.DescriptionStruct),
         "drivebench_bench*": ctypes.c_void_p, "const drivebench_bench*": ctypes.c_void_p,
         "drivebench_bench**": ctypes.POINTER(ctypes.c_void_p), "const drivebench_options*": ctypes.POINTER(library.OptionsStruct),
         "const drivebench_command*": ctypes.POINTER(library.CommandStruct), "drivebench_sample*": ctypes.c_void_p,
         "double*": ctypes.POINTER(ctypes.c_double), "uint64_t*": ctypes.POINTER(ctypes.c_uint64),
         "drivebench_bridge*": ctypes.c_void_p, "const drivebench_bridge*": ctypes.c_void_p,
         "drivebench_bridge**": ctypes.POINTER(ctypes.c_void_p), "const drivebench_leg*": ctypes.POINTER(library.LegStruct),
         "drivebench_bridge_edge*": ctypes.POINTER(library.BridgeEdgeStruct),
         "drivebench_bridge_state*": ctypes.POINTER(library.BridgeStateStruct),
         "drivebench_bridge_means*": ctypes.POINTER(library.BridgeMeansStruct), "int32_t*": ctypes.POINTER(ctypes.c_int32),
         "size_t*": ctypes.POINTER(ctypes.c_size_t), "void*": ctypes.c_void_p, "const void*": ctypes.c_char_p}


def variable(text):
    """(name, ctypes type) of a C declaration."""
    words = text.replace("*", "* ").split()
    name, *sizes = re.findall(r"\w+", words[-1])
    kind = TYPES[re.sub(r" \*", "*", " ".join(words[:-1])).replace("* *", "**")]
    for size in reversed(sizes):
        kind = kind * int(re.search(rf"#define {size} (\d+)", HEADER)[1] if size.startswith("DRIVEBENCH_") else size)
    return name, kind


def members(name):
    body = re.search(rf"typedef struct drivebench_{name} {{(.*?)}}", HEADER, re.DOTALL)[1]
    return [variable(each) for each in body.split(";") if each.strip()]


def enumerators(name):
    body = re.search(rf"enum drivebench_{name} {{(.*?)}}", HEADER, re.DOTALL)[1]
    return {key: int(value) for key, value in re.findall(r"DRIVEBENCH_(\w+)\s*=\s*(-?\d+)", body)}


class Declarations(unittest.TestCase):
    # Catches: a member that is missing, in another place or of another size than in the header.
    def test_structs_are_those_of_the_header(self):
        for name, struct in (("command", library.CommandStruct), ("edge", library.EdgeStruct), ("signal", library.SignalStruct), ("axis", library.AxisStruct),
                             ("parameter", library.ParameterStruct), ("fault", library.FaultStruct),
                             ("injectable", library.InjectableStruct), ("event", library.EventStruct),
                             ("leg", library.LegStruct), ("bridge_edge", library.BridgeEdgeStruct),
                             ("bridge_state", library.BridgeStateStruct), ("bridge_means", library.BridgeMeansStruct),
                             ("description", library.DescriptionStruct),
                             ("options", library.OptionsStruct)):
            self.assertEqual(struct._fields_, members(name), name)

    # Catches: a sample whose attributes are shifted against the signals, and one that the header has and the library not.
    def test_the_sample_is_that_of_the_header(self):
        with drivebench.Bench("inproc:servo") as opened:
            sample = opened.newest()
        self.assertEqual(type(sample)._fields_, members("sample"))
        self.assertEqual(ctypes.sizeof(sample), library.load().sample_size)
        self.assertEqual(list(sample.as_dict()), list(opened.describe().signals))

    # Catches: a name that is written wrong and yet kept, and a copy that changes with the sample it was made from.
    def test_a_sample_has_its_signals_only_and_can_be_copied(self):
        with drivebench.Bench("inproc:servo") as opened:
            sample = opened.newest()
        for change in (lambda: sample.sped_rad_s, lambda: setattr(sample, "sped_rad_s", 1.0)):
            with self.assertRaisesRegex(AttributeError, "sped_rad_s"):
                change()
        for copied in (copy.copy(sample), copy.deepcopy(sample)):
            self.assertEqual(copied, sample)
            copied.speed_rad_s = 5.0
            self.assertNotEqual(copied, sample)

    # Catches: a code, a mode or a state of the gates with the number of another.
    def test_numbers_are_those_of_the_header(self):
        self.assertEqual({each.name: each.value for each in drivebench.Code}, enumerators("code"))
        for name, numbers in (("mode", drivebench.Mode), ("kind", drivebench.Kind), ("type", drivebench.Type),
                              ("gates", bench._Gates)):
            self.assertEqual({f"{name.upper()}_{each.name}": each.value for each in numbers}, enumerators(name))
        self.assertEqual({f"LEG_{each.name}": each.value for each in drivebench.LegMode}, enumerators("leg_mode"))
        self.assertEqual({f"EDGE_{each.name}": each.value for each in drivebench.EdgeKind}, enumerators("edge_kind"))
        with drivebench.Bench("inproc:servo") as opened:
            states = opened.describe().signals["state"].meaning
        self.assertEqual(", ".join(f"{each.value} {each.name.lower()}" for each in drivebench.State), states)
        self.assertEqual(int(re.search(r"define DRIVEBENCH_ABI (\d+)", HEADER)[1]), library.ABI)

    # Catches: a call with other arguments than the header declares, which ctypes cannot see.
    def test_calls_are_those_of_the_header(self):
        declared = {}
        for result, name, arguments in re.findall(r"DRIVEBENCH_API ([\w ]+?\*?) ?drivebench_(\w+)\((.*?)\);", HEADER, re.DOTALL):
            each = [] if arguments == "void" else [variable(one)[1] for one in arguments.split(",")]
            declared[name] = (TYPES[result], tuple(each))
        ours = {**{name: (ctypes.c_int, arguments) for name, arguments in library._CALLS.items()}, **library._OTHERS}
        self.assertEqual(ours, declared)

    # Catches: a package whose version is forgotten when the project's changes.
    def test_the_version_is_the_librarys(self):
        project = (python_package.PACKAGE / "pyproject.toml").read_text(encoding="utf-8")
        self.assertEqual(re.search(r'version = "([^"]+)"', project)[1], drivebench.version())

    # Catches: a library of something else that is taken for ours, and a search that ends without a word.
    def test_what_is_no_library_is_refused(self):
        with self.assertRaisesRegex(drivebench.LibraryNotFound, "cannot be loaded"):
            library.Library("/nowhere/libdrivebench.so")
        with self.assertRaisesRegex(drivebench.OtherAbi, "is no libdrivebench of ABI 1"):
            library.Library(ctypes.util.find_library("c"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
