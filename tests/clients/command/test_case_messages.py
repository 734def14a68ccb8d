#!/usr/bin/python3
"""Steps of `drivebench test` that are messages to the device under test: a line, a CAN frame, registers of its Modbus server."""
import pathlib
import subprocess
import sys
import unittest
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
try:
    from free_port import free_ports
    from regression_case import COMMAND, FAILED, USAGE, RegressionTest
    from wire_client import PATIENCE_S
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

CASE = """bench = "dc-a-voltage"
duration_s = 0.02
[dut]
command = ["/usr/bin/python3", "device.py"{words}]
link = "{link}"
[[check]]
kind = "always"
condition = "i_a_a < 30"
"""

# Prints what it hears, with the tick of the sample that it has by then. Time stands still meanwhile.
LISTENS = """import os, select, socket, struct, sys, threading, time
import drivebench

def lines():
    return os.read(0, 4096).decode().split("\\n")[:-1] if select.select([0], [], [], 0)[0] else []

bus = None
def frames():
    global bus
    if bus is None:
        host, port = os.environ["DRIVEBENCH_LINK"].split("?")[0].rsplit(":", 2)[1:]
        bus = socket.create_connection((host.strip("/"), int(port)))
        bus.sendall(b"O\\r")
        time.sleep(0.2)
    heard = b""
    while select.select([bus], [], [], 0.05 if sample.tick in (49, 50) else 0)[0]:
        heard += bus.recv(65536)
    return [text for text in heard.decode().split("\\r") if text.startswith("t123")]

written = []
def serve(listener):
    while True:
        client = listener.accept()[0]
        with client:
            while head := client.recv(7):
                number, _, length, unit = struct.unpack(">HHHB", head)
                pdu = client.recv(length - 1)
                first, second = struct.unpack(">HH", pdu[1:5])
                values = [second] if pdu[0] == 6 else list(struct.unpack(f">{second}H", pdu[6:]))
                written.append(f"{pdu[0]} {unit} {first} {values}")
                client.sendall(struct.pack(">HHHB", number, 0, 6, unit) + pdu[:5])
def registers():
    heard, written[:] = list(written), []
    return heard

hear = {"line": lines, "can": frames, "modbus": registers}[sys.argv[1]]
if sys.argv[1] == "modbus":
    threading.Thread(target=serve, args=(socket.create_server(("127.0.0.1", int(sys.argv[2]))),), daemon=True).start()
with drivebench.Bench(os.environ["DRIVEBENCH_LINK"]) as bench:
    bench.acquire()
    sample = bench.newest()
    while True:
        for text in hear():
            print(sample.tick, text, flush=True)
        sample = bench.step(voltages=5.0)
"""


class Messages(RegressionTest):
    def case_of(self, steps, kind, link="unix", port=None, code=0, arguments=()):
        self.write("device.py", LISTENS)
        words = f', "{kind}"' + (f', "{port}"' if port else "")
        self.write("case.toml", CASE.format(words=words, link=link) + steps)
        return self.suite(*arguments, code=code)["cases"][0]

    def heard(self, case):
        return [line for line in case["output"].splitlines() if line[:1].isdigit()]

    def test_a_line_comes_before_the_sample_of_its_tick(self):
        """Catches: a line that comes a tick late or early, twice, or never; runs that differ."""
        steps = ('[[step]]\nat_s = 0.005\nline = "speed 50"\n[[step]]\nat_s = 0.0\nline = "hello"\n'
                 '[[step]]\nwhen = "speed_rad_s > 1"\nfor_s = 0.001\ndelay_s = 0.002\nline = "it turns"\n')
        cases = [self.case_of(steps, "line") for _ in range(2)]
        self.assertEqual(cases[0], cases[1])
        heard = self.heard(cases[0])
        tick = int(heard[1].split()[0])
        self.assertEqual(heard, ["0 hello", f"{tick} it turns", "50 speed 50"])
        self.assertEqual(cases[0]["messages"], ['0 s: line "hello"', f'{tick / 10000:.6g} s: line "it turns"', '0.005 s: line "speed 50"'])

    def test_a_condition_counts_as_that_of_a_load(self):
        """Catches: a message on a condition that comes in another tick than an event of the bench on the same condition."""
        when = 'when = "speed_rad_s > 1"\nfor_s = 0.001\ndelay_s = 0.002\n'
        case = self.case_of(f'[[step]]\n{when}line = "now"\n[[step]]\n{when}load_nm = 0.001\n'
                            '[[check]]\nname = "load"\nkind = "always"\ncondition = "load_nm == 0"\n', "line", code=FAILED)
        tick = int(self.heard(case)[0].split()[0])
        load = next(check for check in case["checks"] if check["name"] == "load")
        self.assertEqual(round(load["at_s"] * 1e4), tick + 1)  # acts in the tick, so the next sample has it

    def test_a_frame_comes_before_the_sample_of_its_tick(self):
        """Catches: a frame that comes late, twice, or with other bytes."""
        case = self.case_of('[[step]]\nat_s = 0.005\ncan = {id = 0x123, data = "0f 00 a1", fd = false}\n', "can", link="can")
        self.assertEqual(self.heard(case), ["50 t12330F00A1"])
        self.assertEqual(case["messages"], ["0.005 s: frame 123#0f00a1"])

    def test_registers_are_written_before_the_sample_of_their_tick(self):
        """Catches: time that goes on before the device has confirmed its registers, another function, unit or address."""
        port = free_ports(1)[0]
        place = f'to = "127.0.0.1:{port}", unit = 7'
        case = self.case_of(f'[[step]]\nat_s = 0.005\nmodbus = {{{place}, register = 100, values = [1500]}}\n'
                            f'[[step]]\nat_s = 0.006\nmodbus = {{{place}, register = 200, values = [1, 65535]}}\n', "modbus", port=port)
        self.assertEqual(self.heard(case), ["50 6 7 100 [1500]", "60 16 7 200 [1, 65535]"])

    def test_a_message_that_does_not_arrive_is_an_error(self):
        """Catches: a case that passes although its device was never told."""
        port = free_ports(1)[0]
        case = self.case_of(f'[[step]]\nat_s = 0.005\nmodbus = {{to = "127.0.0.1:{port}", register = 1, values = [1]}}\n', "line", code=FAILED)
        self.assertEqual(case["verdict"], "error")
        self.assertRegex(case["reason"], r"^registers 1 = 1 of unit 1 at 127\.0\.0\.1:\d+ at 0\.005 s did not arrive: ")
        case = self.case_of("".join(f'[[step]]\nat_s = {i / 10000}\nline = "{"x" * 490}"\n' for i in range(150)), "modbus", port=port, code=FAILED)
        self.assertRegex(case["reason"], "did not arrive: the device does not read its standard input, which is full")

    def test_the_bundle_says_what_was_told_and_tells_it_again(self):
        """Catches: a bundle without the messages, and a run from the middle whose device lacks those of before."""
        self.case_of('[[step]]\nat_s = 0.005\nline = "speed 50"\n[[check]]\nname = "x"\nkind = "always"\ncondition = "i_a_a < 0"\n', "line",
                     code=FAILED, arguments=("--keep", self.folder / "kept", "--html", self.folder / "page.html"))
        self.assertIn("0.005 s: line &quot;speed 50&quot;", (self.folder / "page.html").read_text(encoding="utf-8").replace('"', "&quot;"))
        bundle = self.folder / "kept/case.zip"
        with zipfile.ZipFile(bundle) as parts:
            self.assertEqual(parts.read("messages.txt"), b'0.005 s: line "speed 50"\n')
        for arguments, code, said in (((), FAILED, "the same to the bit: 201 samples"),
                                      (("--from", "100"), USAGE, "--from: the case has messages to its device under test"),
                                      (("--plant-only",), 0, "the plant is the same to the bit")):
            again = subprocess.run([COMMAND, "rerun", str(bundle), *arguments], capture_output=True, text=True, env=self.environment,
                                   timeout=PATIENCE_S, check=False)
            self.assertEqual(again.returncode, code, again.stdout + again.stderr)
            self.assertIn(said, again.stdout + again.stderr)

    def test_what_cannot_be_told_is_refused(self):
        """Catches: a message that nothing hears, and a mistake in one that is found after the suite has begun."""
        def refused(text):
            self.write("device.py", LISTENS)
            self.write("case.toml", text)
            done = subprocess.run([COMMAND, "test", str(self.folder / "suite")], capture_output=True, text=True, env=self.environment,
                                  timeout=PATIENCE_S, check=False)
            self.assertEqual(done.returncode, USAGE, done.stdout + done.stderr)
            return done.stderr

        whole = CASE.format(words=', "line"', link="unix")
        preset = whole.replace('command = ["/usr/bin/python3", "device.py", "line"]\nlink = "unix"', 'preset = "book/2.18-own-current-loop"')
        step = "[[step]]\nat_s = 0.005\n"
        to = 'to = "127.0.0.1:502", register = '
        for text, why in (
                (preset + step + 'line = "x"\n', "of line 8 has line, which belongs to a command: it goes to the standard input"),
                (preset + step + "modbus = {" + to + "1, values = [1]}\n", "has modbus, which belongs to a command or an attached drive"),
                (whole + step + "can = {id = 1}\n", "has can, which needs the device under test on a CAN bus"),
                (whole + step + 'line = "x"\nload_nm = 1.0\n', "of which a step has exactly one; here are 2"),
                (whole + step + 'line = "x\\ny"\n', 'line is "x?y" but must be text in quotes'),
                (whole + step + "modbus = {" + to + "65535, values = [1, 2]}\n", "case.toml:9: step message.modbus.values reach beyond register 65535"),
                (whole + step + 'modbus = {to = "drive:502", register = 1, values = [1]}\n', 'is "drive:502" but must be ADDRESS:PORT'),
                (whole + step + "modbus = {" + to + "1, values = [70000]}\n", "must be whole numbers from 0 to 65535"),
                (whole.replace("unix", "can") + step + 'can = {id = 0x800, data = "00"}\n', "id is"),
                (whole.replace("unix", "can") + step + 'can = {id = 1, data = "0"}\n', "must be bytes of two hexadecimal digits"),
                (whole.replace("unix", "can") + step + 'can = {id = 1, fd = false, data = "000102030405060708"}\n', "a classic frame has at most 8")):
            with self.subTest(why):
                self.assertIn(why, refused(text))


if __name__ == "__main__":
    unittest.main()
