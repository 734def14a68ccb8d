"""A strict importer of Functional Mock-up Units for co-simulation, written from the standards FMI 2.0 and 3.0."""
import ctypes
import pathlib
import re
import zipfile
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_int32, c_int64, c_size_t, c_uint32, c_uint64, c_void_p
from xml.etree import ElementTree

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
LOGGER_2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)  # with one argument after its format
LOGGER_3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
TYPES_3 = {"Float64": c_double, "Int32": c_int32, "Int64": c_int64, "UInt64": c_uint64}


class Callbacks(ctypes.Structure):
    _fields_ = [("logger", LOGGER_2), ("allocate", c_void_p), ("free", c_void_p), ("finished", c_void_p), ("environment", c_void_p)]


class Refused(Exception):
    """A call whose status was no OK."""

    def __init__(self, call, status, log):
        super().__init__(f"{call}: status {status}: {log}")
        self.status = status
        self.log = log


class Variable:
    def __init__(self, reference, type_name, attributes):
        self.reference = reference
        self.type = type_name
        self.causality = attributes["causality"]
        self.variability = attributes["variability"]
        self.attributes = attributes

    def number(self, key):
        return float(self.attributes[key]) if key in self.attributes else None


def check(condition, rule):
    if not condition:
        raise AssertionError(rule)


def check_variables(variables, units):
    """What both standards ask of the list of variables."""
    for name, v in variables.items():
        check(v.causality in ("input", "output", "parameter", "independent"), f"{name}: causality")
        if v.causality == "parameter":
            check(v.variability in ("fixed", "tunable"), f"{name}: a parameter is fixed or tunable")
        elif v.causality != "independent":
            check(v.variability in ("discrete", "continuous"), f"{name}: variability {v.variability}")
            check(v.variability == "discrete" or v.type in ("Real", "Float64"), f"{name}: only reals are continuous")
        check((v.causality in ("input", "parameter")) == ("start" in v.attributes), f"{name}: start")
        if "unit" in v.attributes:
            check(v.attributes["unit"] in units, f"{name}: no UnitDefinition of {v.attributes['unit']}")
        start, low, high = v.number("start"), v.number("min"), v.number("max")
        check(start is None or low is None or start >= low, f"{name}: start below min")
        check(start is None or high is None or start <= high, f"{name}: start above max")


class Fmu:
    """An unpacked unit; which standard it follows is told by its model description."""

    def __init__(self, file, folder):
        self.folder = pathlib.Path(folder).resolve()
        with zipfile.ZipFile(file) as archive:
            check(archive.testzip() is None, "a file in the archive is damaged")
            check("modelDescription.xml" in archive.namelist(), "no modelDescription.xml")
            archive.extractall(self.folder)
        self.root = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        check(self.root.tag == "fmiModelDescription", "wrong root element")
        self.version = self.root.attrib["fmiVersion"]
        check(self.version in ("2.0", "3.0"), "unknown fmiVersion")
        self.token = self.root.attrib["guid" if self.version == "2.0" else "instantiationToken"]
        self.identifier = self.root.find("CoSimulation").attrib["modelIdentifier"]
        check(re.fullmatch(r"[A-Za-z_][A-Za-z_0-9]*", self.identifier), "modelIdentifier must be a C identifier")
        units = [unit.attrib["name"] for unit in self.root.find("UnitDefinitions")]
        check(len(units) == len(set(units)), "a unit is defined twice")
        self.step_s = float(self.root.find("DefaultExperiment").attrib["stepSize"])
        self.variables = self.read_2() if self.version == "2.0" else self.read_3()
        check_variables(self.variables, units)
        place = "linux64" if self.version == "2.0" else "x86_64-linux"
        self.library = self.folder / "binaries" / place / f"{self.identifier}.so"
        check(self.library.is_file(), f"no {self.library}")

    def check_order(self, order):
        tags = [child.tag for child in self.root]
        check([tag for tag in order if tag in tags] == tags, f"the elements stand in a wrong order: {tags}")

    def read_2(self):
        self.check_order(["ModelExchange", "CoSimulation", "UnitDefinitions", "TypeDefinitions", "LogCategories",
                          "DefaultExperiment", "VendorAnnotations", "ModelVariables", "ModelStructure"])
        variables = {}
        elements = list(self.root.find("ModelVariables"))
        for element in elements:
            check(element.tag == "ScalarVariable" and len(element) == 1, "a ScalarVariable has one type")
            check(element[0].tag in ("Real", "Integer"), f"type {element[0].tag}")
            name = element.attrib["name"]
            check(name not in variables, f"{name} stands there twice")
            variables[name] = Variable(int(element.attrib["valueReference"]), element[0].tag, {**element.attrib, **element[0].attrib})
        outputs = [place for place, element in enumerate(elements, 1) if element.attrib["causality"] == "output"]
        for part in ("Outputs", "InitialUnknowns"):
            listed = [int(unknown.attrib["index"]) for unknown in self.root.find("ModelStructure").find(part)]
            check(listed == outputs, f"{part} must list every output, in ascending order")
        return variables

    def read_3(self):
        self.check_order(["ModelExchange", "CoSimulation", "ScheduledExecution", "UnitDefinitions", "TypeDefinitions",
                          "LogCategories", "DefaultExperiment", "ModelVariables", "ModelStructure", "Annotations"])
        variables = {}
        for element in self.root.find("ModelVariables"):
            check(element.tag in TYPES_3, f"type {element.tag}")
            check(element.tag == "Float64" or "unit" not in element.attrib, "only floating-point variables have units")
            name = element.attrib["name"]
            check(name not in variables, f"{name} stands there twice")
            variables[name] = Variable(int(element.attrib["valueReference"]), element.tag, element.attrib)
        references = [v.reference for v in variables.values()]
        check(len(references) == len(set(references)), "a value reference stands there twice")
        check([v.causality for v in variables.values()].count("independent") == 1, "FMI 3 wants one independent variable")
        outputs = [v.reference for v in variables.values() if v.causality == "output"]
        for part in ("Output", "InitialUnknown"):
            listed = [int(each.attrib["valueReference"]) for each in self.root.find("ModelStructure").findall(part)]
            check(listed == outputs, f"every output is one {part}")
        return variables

    def open(self, **changes):
        return (Instance2 if self.version == "2.0" else Instance3)(self, **changes)


class Instance:
    """One instance of a unit, in the states of the standard: initialised by start()."""

    prefix = ""

    def __init__(self, fmu):
        self.fmu = fmu
        self.log = []
        self.library = ctypes.CDLL(str(fmu.library))
        self.component = None

    def call(self, name, *arguments):
        function = getattr(self.library, self.prefix + name)
        function.restype = c_int
        self.log.clear()
        status = function(c_void_p(self.component), *arguments)
        if status != OK:
            raise Refused(name, status, list(self.log))

    def started(self, component):
        if not component:
            raise Refused("Instantiate", ERROR, list(self.log))
        self.component = component

    def close(self):
        free = getattr(self.library, self.prefix + "FreeInstance")
        free.restype = None
        free(c_void_p(self.component))
        self.component = None

    def reset(self):
        self.call("Reset")

    def keep(self):
        state = c_void_p()
        self.call("Get" + self.state, byref(state))
        return state

    def go_back(self, state):
        self.call("Set" + self.state, state)

    def forget(self, state):
        self.call("Free" + self.state, byref(state))

    def to_bytes(self, state):
        size = c_size_t()
        self.call(f"Serialized{self.state}Size", state, byref(size))
        room = ctypes.create_string_buffer(size.value)
        self.call("Serialize" + self.state, state, room, size)
        return room.raw

    def from_bytes(self, raw):
        state = c_void_p()
        self.call(self.deserialize + self.state, raw, c_size_t(len(raw)), byref(state))
        return state

    def get(self, *names):
        values = [self.get_one(self.fmu.variables[name]) for name in names]
        return values[0] if len(names) == 1 else values

    def set(self, **values):
        self.set_all(values)

    def set_all(self, values):
        for name, value in values.items():
            self.set_one(self.fmu.variables[name], value)

    def outputs(self):
        return {name: self.get_one(v) for name, v in self.fmu.variables.items() if v.causality == "output"}


class Instance2(Instance):
    prefix = "fmi2"
    state = "FMUstate"
    deserialize = "DeSerialize"
    types = {"Real": c_double, "Integer": c_int}

    def __init__(self, fmu, token=None, resources=None, logs=True):
        super().__init__(fmu)

        def keep_log(_environment, _instance, status, _category, message, sentence):
            check(message == b"%s", "the message is a format")
            self.log.append((status, sentence.decode()))

        self.callbacks = Callbacks(LOGGER_2(keep_log), None, None, None, None)
        version = self.library.fmi2GetVersion
        version.restype = c_char_p
        check(version() == b"2.0", "fmi2GetVersion")
        instantiate = self.library.fmi2Instantiate
        instantiate.restype = c_void_p
        where = resources if resources is not None else (fmu.folder / "resources").as_uri()
        self.started(instantiate(b"it", c_int(1), (token or fmu.token).encode(), where.encode(), byref(self.callbacks), c_int(0), c_int(logs)))

    def start(self, start_s=0.0):
        self.call("SetupExperiment", c_int(0), c_double(0), c_double(start_s), c_int(0), c_double(0))
        self.call("EnterInitializationMode")
        self.call("ExitInitializationMode")

    def get_one(self, v):
        value = self.types[v.type]()
        self.call("Get" + v.type, (c_uint32 * 1)(v.reference), c_size_t(1), byref(value))
        return value.value

    def set_one(self, v, value):
        self.call("Set" + v.type, (c_uint32 * 1)(v.reference), c_size_t(1), byref(self.types[v.type](value)))

    def step(self, at_s, step_s):
        self.call("DoStep", c_double(at_s), c_double(step_s), c_int(1))


class Instance3(Instance):
    prefix = "fmi3"
    state = "FMUState"
    deserialize = "Deserialize"

    def __init__(self, fmu, token=None, resources=None, logs=True):
        super().__init__(fmu)

        def keep_log(_environment, status, _category, sentence):
            self.log.append((status, sentence.decode()))

        self.logger = LOGGER_3(keep_log)
        version = self.library.fmi3GetVersion
        version.restype = c_char_p
        check(version() == b"3.0", "fmi3GetVersion")
        instantiate = self.library.fmi3InstantiateCoSimulation
        instantiate.restype = c_void_p
        where = resources if resources is not None else f"{fmu.folder}/resources/"
        self.started(instantiate(b"it", (token or fmu.token).encode(), where.encode(), c_bool(False), c_bool(logs), c_bool(False),
                                 c_bool(False), None, c_size_t(0), None, self.logger, None))

    def start(self, start_s=0.0):
        self.call("EnterInitializationMode", c_bool(False), c_double(0), c_double(start_s), c_bool(False), c_double(0))
        self.call("ExitInitializationMode")

    def get_one(self, v):
        value = TYPES_3[v.type]()
        self.call("Get" + v.type, (c_uint32 * 1)(v.reference), c_size_t(1), byref(value), c_size_t(1))
        return value.value

    def set_one(self, v, value):
        value = TYPES_3[v.type](value)
        self.call("Set" + v.type, (c_uint32 * 1)(v.reference), c_size_t(1), byref(value), c_size_t(1))

    def step(self, at_s, step_s):
        flags = [c_bool() for _ in range(3)]
        last_s = c_double()
        self.call("DoStep", c_double(at_s), c_double(step_s), c_bool(True), *map(byref, flags), byref(last_s))
        check(not any(flag.value for flag in flags), "the unit asks for what it does not have")
        check(abs(last_s.value - (at_s + step_s)) < 1e-12, "lastSuccessfulTime")
