"""canmatrix, which this project did not write, reads the DBC file and takes frames apart as the codec does."""
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

try:
    import can
    import canmatrix
    import canmatrix.formats
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

BUILT = pathlib.Path(os.environ["DRIVEBENCH_SERVER"]).parent
VARIANTS = [(kind, ids, width) for kind in ("classic", "fd") for ids in ("standard", "extended")
            for width in ("narrow", "wide")]
NODES = {"servo": 1, "_2nd__load_": 2, "node15": 15}


def texts(what, *variant):
    return subprocess.run([BUILT / "can_texts", what, *variant], check=True, capture_output=True, timeout=60).stdout


def load(dbc):
    """canmatrix 0.9.5 prints the lines that it cannot read and goes on; also the formats that lack a package."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "bench.dbc"
        path.write_bytes(dbc)
        program = f"import canmatrix.formats; canmatrix.formats.loadp_flat({str(path)!r})"
        said = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True, timeout=60)
        lines = (said.stdout + said.stderr).splitlines()
        complaints = [line for line in lines if not line.endswith(" is not supported")]
        return canmatrix.formats.loadp_flat(str(path)), complaints


def rows(table, heading):
    """The cells of the lines of the first table below a heading."""
    lines = table[table.index(heading) + len(heading):].lstrip("\n").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("|---")) + 1
    found = []
    for line in lines[start:]:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


class Dbc(unittest.TestCase):
    def each(self):
        return ((variant, load(texts("dbc", *variant))) for variant in VARIANTS)

    def test_canmatrix_finds_the_cycle_times(self):
        """Catches: an attribute that another program does not find, times in seconds."""
        for (kind, ids, width), (matrix, _) in self.each():
            with self.subTest(kind=kind, ids=ids, width=width):
                times = {frame.name: frame.cycle_time for frame in matrix.frames}
                self.assertEqual((times["sync"], times["servo_command"], times["servo_state"], times["servo_heartbeat"],
                                  times["servo_reply"]), (2, 2, 160, 100, 0))

    def test_canmatrix_reads_it_without_complaint(self):
        """Catches: a line that the reader does not understand; names that are no identifiers, too long or not unique; FD
        or extended frames that are not marked."""
        for (kind, ids, width), (matrix, complaints) in self.each():
            self.assertEqual(complaints, [])
            names = [frame.name for frame in matrix.frames]
            self.assertEqual(len(names), len(set(names)))
            for frame in matrix.frames:
                self.assertRegex(frame.name, r"^[A-Za-z_][A-Za-z0-9_]{0,31}$")
                self.assertEqual((frame.is_fd, frame.arbitration_id.extended), (kind == "fd", ids == "extended"))
                self.assertEqual(len({signal.name for signal in frame.signals}), len(frame.signals))
            for node in NODES:
                self.assertIn(f"{node}_heartbeat", names)
            self.assertEqual([node for node in NODES if f"{node}_details" in names],
                             ["servo", "node15"] if width == "wide" else [])
            self.assertEqual([ecu.name for ecu in matrix.ecus], ["Bench", "Controller"])
            self.assertEqual(matrix.frame_by_name("servo_command").transmitters, ["Controller"])
            self.assertEqual(matrix.frame_by_name("servo_command").signals[0].receivers, ["Bench"])
            self.assertEqual(matrix.frame_by_name("servo_heartbeat").transmitters, ["Bench"])

    def test_every_frame_means_the_same_to_codec_and_file(self):
        """Catches: a start bit, size, sign, factor, float mark or identifier that differs from the codec's."""
        for variant, (matrix, _) in self.each():
            seen = set()
            for line in texts("frames", *variant).decode().splitlines():
                number, data, *fields = line.split()
                frame = matrix.frame_by_id(canmatrix.ArbitrationId(int(number, 16), variant[1] == "extended"))
                self.assertIsNotNone(frame, line)
                seen.add(frame.name)
                self.check_values(frame, bytes.fromhex(data), dict(field.split("=") for field in fields))
            self.assertEqual(seen, {frame.name for frame in matrix.frames})

    def check_values(self, frame, data, values):
        self.assertEqual(len(data), frame.size)
        theirs = frame.decode(data)
        if frame.name.endswith("command"):  # its set-points have a name for each mode; gates off and zero voltage have none
            name = {"1": "u", "3": "duty_mid", "4": "i", "5": "duty"}.get(values["mode"])
            values = {name + key[1:] if key.startswith("u_") else key: value for key, value in values.items()
                      if name is not None or not key.startswith("u_")}
        self.assertEqual(set(theirs), set(values))
        for name, text in values.items():
            signal, ours = frame.signal_by_name(name), float(text)
            raw, value = theirs[name].raw_value, float(theirs[name].phys_value)
            if signal.is_float:
                self.assertTrue(ours == value or (math.isnan(ours) and math.isnan(value)), (frame.name, name))
            elif math.isnan(ours):  # the pattern of "no value"
                self.assertEqual(raw, -2**(signal.size - 1) if signal.is_signed else 2**signal.size - 1)
            else:
                self.assertTrue(math.isclose(ours, value, rel_tol=1e-12), (frame.name, name, ours, value))

    def test_every_field_matches_the_markdown_table(self):
        """Catches: a name, place, unit, range or meaning in which the two texts differ; a choice without a name; the
        edges in the wrong place."""
        for variant, (matrix, _) in self.each():
            table = texts("table", *variant).decode()
            for row in rows(table, "## Identifiers"):
                title, sender, identifiers = row[0], row[1], row[2:]
                name = title.partition(" (")[0]
                for (axis, _), identifier in zip(NODES.items(), identifiers):
                    if identifier == "-":
                        continue
                    frame = matrix.frame_by_name(name if name == "sync" else f"{axis}_{name}")
                    self.assertEqual(frame.arbitration_id.id, int(identifier, 16))
                    self.assertEqual(frame.transmitters, [sender.capitalize()])
                    last = frame
                frame, fields = last, rows(table, f"### {title}\n")
                self.assertEqual([field[1] for field in fields], [signal.name for signal in frame.signals])
                for field, signal in zip(fields, frame.signals):
                    self.check_field(field, signal, ("page", "mode") if any(f[2].startswith("mode ") for f in fields) else ("page",))

    def check_field(self, field, signal, selectors):
        where, _, encoding, unit, limits, no_value, meaning = field
        place, _, half = where.partition(" ")
        first, _, last = place.partition("-")
        size = 4 if half else 8 * (int(last or first) - int(first) + 1)
        self.assertEqual((signal.start_bit, signal.size), (8 * int(first) + (4 if half == "high half" else 0), size))
        self.assertTrue(signal.is_little_endian)
        page, kind, bits, factor = re.fullmatch(r"(?:(?:page|mode) (\d): )?(uint|int|float)(\d+)(?:, wraps| x (.+))?",
                                                encoding).groups()
        self.assertEqual(signal.multiplex, "Multiplexor" if signal.name in selectors else page and int(page))
        self.assertEqual((int(bits), kind != "uint", kind == "float"), (signal.size, signal.is_signed, signal.is_float))
        self.assertEqual(float(factor or 1), float(signal.factor))
        self.assertEqual("" if unit in ("-", "bits", "enum") else unit, signal.unit)
        self.assertEqual(limits, "any" if signal.min == signal.max == 0 else f"{float(signal.min):.10g} to "
                         f"{float(signal.max):.10g}")
        self.assertEqual(signal.comment.partition("; ")[0], meaning.partition("; ")[0])
        self.assertEqual("no value" in signal.comment, no_value != "-")
        given = signal.name in ("faults", "injected")  # their bits come from the caller
        self.assertEqual(bool(signal.values), unit == "enum" or (unit == "bits" and not given))
        for number, label in signal.values.items():
            self.assertIn(f"{number} {label}", meaning)

    def test_the_examples_and_the_program_for_recorded_frames_work(self):
        """Catches: an example whose bytes are not a frame; a program in the text that does not run."""
        for variant in VARIANTS:
            table = texts("table", *variant).decode()
            program = re.search(r"```python\n(.*?)```", table, re.S).group(1)
            examples = rows(table, "## Examples")
            with tempfile.TemporaryDirectory() as folder:
                log = "".join(f"(1.{i:06}) can0 {row[1].strip('`')}\n" for i, row in enumerate(examples))
                (pathlib.Path(folder) / "run.log").write_text(log, encoding="utf-8")
                (pathlib.Path(folder) / "bench.dbc").write_bytes(texts("dbc", *variant))
                ran = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True,
                                     timeout=60)
            self.assertEqual(ran.returncode, 0, ran.stderr)
            lines = ran.stdout.splitlines()
            self.assertEqual(len(lines), len(examples))
            for line, (title, _, values) in zip(lines, examples):
                self.assertRegex(line.split()[1], f"(^|_){title.partition(' (')[0]}$")
                for field in values.split(", "):
                    label, number = field.split()[:2]
                    found = re.search(f"'{label}': '([^' ]*)", line).group(1)
                    self.assertTrue(math.isclose(float(found), float(number), rel_tol=1e-6), (line, field))


if __name__ == "__main__":
    unittest.main()
