"""The reference controller over every link of the real server, and what the command says of interfaces."""
import json
import pathlib
import socket
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from free_port import free_udp_port  # noqa: E402
from wire_client import BENCHES, PATIENCE_S, SERVER, Server, pb  # noqa: E402

COMMAND = SERVER.with_name("drivebench")
PORT = free_udp_port()  # of the multicast bus: one bus for each port


def run(*arguments):
    return subprocess.run([COMMAND, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False)


def bench(name, **replacements):
    """A shipped bench file that works from any folder, with lines put in place of others."""
    text = (BENCHES / name).read_text(encoding="utf-8").replace("../motors", str(BENCHES.parent / "motors"))
    lines = []
    for line in text.split("\n"):
        key = line.split("=")[0].strip()
        lines.append(f"{key} = {replacements[key]}" if key in replacements else line)
    return "\n".join(lines)


def multicast(fd):
    text = bench("servo-can.toml", fd=fd).replace("port = 43113", f"port = {PORT}")
    return text, lambda server: f"can:udp_multicast:239.74.163.2:{PORT}?fd={int(fd == 'true')}"


def slcan(fd):
    text = bench("servo-can.toml", fd=fd, backend='"slcan"', channel='"tcp:127.0.0.1:0"').replace("port = 43113\n", "")
    return text, lambda server: f"can:{server.ready['can'][0]}?fd={int(fd == 'true')}"


def modbus():
    text = bench("servo-modbus.toml").replace("port = 1502", "port = 0")
    return text, lambda server: f"modbus:{server.ready['modbus']}"


class Links(unittest.TestCase):
    def control(self, link, *arguments):
        done = run("control", "--json", "--link", link, *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def hash_of_two_moves(self, text, link_of):
        """The hash counts refused commands, and a link says again what got no answer within 20 ms of a busy machine: such
        runs do not count."""
        for _ in range(5):
            *found, refused = self.two_moves(text, link_of)
            if refused == 0:
                return found
        return self.fail("every run had a command that was said again")

    def two_moves(self, text, link_of):
        with Server(text=text) as server:
            link = link_of(server)
            first = self.control(link)
            second = self.control(link)  # from where the first one stopped, over its lease and its rest
            with server.client() as looking:
                refused = looking.status().axes[0].sample.refused_commands
            self.assertEqual(server.stop(), 0, server.errors())
            self.assertTrue(server.verdict["exact"])
            for report in (first, second):
                self.assertEqual(report["mode"], "lockstep")
                self.assertEqual(report["samples"], 1024)
                self.assertEqual(report["missed_ticks"], 0)
                self.assertLessEqual(report["peak_error_counts"], 3.0)
            self.assertEqual(server.verdict["ticks"], first["samples"] + second["first_tick"])
            return first, server.verdict["state_hash"], refused

    # Catches: a link that costs a tick, a count or a bit: float32 is float32 on CAN FD and on Modbus.
    def test_every_link_with_floats_gives_the_same_run(self):
        can, can_hash = self.hash_of_two_moves(*multicast("true"))
        _, slcan_hash = self.hash_of_two_moves(*slcan("true"))
        over_modbus, modbus_hash = self.hash_of_two_moves(*modbus())
        self.assertEqual(can_hash, slcan_hash)
        self.assertEqual(can_hash, modbus_hash)
        self.assertEqual(can["angle_source"], "encoder")
        self.assertIsNone(can["final_true_error_counts"])
        self.assertIsNone(can["peak_voltage_v"])
        self.assertEqual(over_modbus["angle_source"], "truth")

    # Catches: scaled integers that are read in other units than they were written in.
    def test_classic_frames_give_the_same_run_on_every_bus(self):
        _, first = self.hash_of_two_moves(*multicast("false"))
        _, second = self.hash_of_two_moves(*slcan("false"))
        self.assertEqual(first, second)

    # Catches: two controllers of one axis, and an exit code of 0 for the one that was turned away.
    def test_an_axis_that_is_taken_is_refused_on_every_link(self):
        for text, link_of in (multicast("true"), modbus()):
            with Server(text=text) as server, server.client() as owner:
                owner.ask(lease=pb.LeaseRequest(axis=0, action=pb.LeaseRequest.ACTION_ACQUIRE))
                done = run("control", "--link", link_of(server))
                self.assertEqual(done.returncode, 1, done.stderr)
                self.assertIn("another session holds the lease of the axis", done.stderr)

    # Catches: a fault that is overlooked because the link has no names for it, and a clear that does nothing.
    def test_a_latched_fault_is_reported_and_cleared(self):
        for text, link_of in (multicast("true"), multicast("false"), modbus()):
            with Server(text=text) as server:
                with server.client() as owner:
                    owner.ask(lease=pb.LeaseRequest(axis=0, action=pb.LeaseRequest.ACTION_ACQUIRE))
                    command = pb.Command(axis=0, tick=0, gates=pb.GATES_OFF)
                    owner.ask(exchange=pb.Exchange(commands=[command]))
                # The lease is lost with the connection, which latches.
                done = run("control", "--link", link_of(server))
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertIn("--clear", done.stderr)
                self.control(link_of(server), "--clear")

    # Catches: an option that a link cannot serve and that is passed over.
    def test_a_request_that_the_link_cannot_carry_is_refused(self):
        text, link_of = multicast("true")
        with Server(text=text) as server:
            link = link_of(server)
            for arguments, why in ((["--load", "0.1@0.03"], "--load needs"), (["--axis", "1"], "?node=N"),
                                   (["--set", "machine.pole_pairs=3"], "over CAN")):
                done = run("control", "--link", link, *arguments)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertIn(why, done.stderr)
            done = run("control", "--link", link.replace("fd=1", "fd=0"))
            self.assertEqual(done.returncode, 3)
            self.assertIn("agree on fd", done.stderr)

    # Catches: a trace that other programs cannot read, or that misses what the bench says.
    def test_can_log_writes_the_heartbeats(self):
        text, link_of = multicast("true")
        with Server(text=text) as server, tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "bus.log"
            done = run("can-log", link_of(server), "--count", "2", "--output", str(out))
            self.assertEqual(done.returncode, 0, done.stderr)
            lines = out.read_text(encoding="utf-8").splitlines()
            self.assertEqual(len(lines), 2)
            for line in lines:
                self.assertRegex(line, r"^\(\d+\.\d{6}\) udp_multicast 791##1")

    # Catches: the last burst before a bus breaks, which is what one wants to see, lost with it.
    def test_can_log_keeps_what_came_before_the_bus_broke(self):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "bus.log"
            done = self.logged(out, 1000)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("was closed", done.stderr)
            self.assertEqual(len(out.read_text(encoding="utf-8").splitlines()), 1000)

    # Catches: a trace that grows in memory as long as the bus is never silent.
    def test_can_log_writes_although_the_bus_is_never_silent(self):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "bus.log"
            written = []
            self.logged(out, 1_000_000, lambda: written.append(out.stat().st_size))
            self.assertGreater(written[0], 1 << 20)
            self.assertEqual(out.read_bytes().count(b"\n"), 1_000_000)

    def logged(self, out, frames, before_the_end=lambda: None):
        """The log of an adapter that sends so many frames without a pause, and is gone."""
        adapter = socket.create_server(("127.0.0.1", 0))
        with adapter, subprocess.Popen([COMMAND, "can-log", "can:slcan:tcp:%s:%d" % adapter.getsockname(), "--output", out],
                                       stderr=subprocess.PIPE, text=True) as logging:
            adapter.settimeout(PATIENCE_S)
            peer, _ = adapter.accept()
            with peer:
                said = b""
                while not said.endswith(b"O\r"):
                    said += peer.recv(64)
                peer.sendall(b"t12380011223344556677\r" * frames)
                before_the_end()
            _, err = logging.communicate(timeout=PATIENCE_S)
            return subprocess.CompletedProcess(logging.args, logging.returncode, "", err)

    # Catches: a description that is not printed, or of another bench.
    def test_descriptions_of_interfaces_are_printed(self):
        for arguments, part in ((["dbc", str(BENCHES / "servo-can.toml")], "BO_ "),
                                (["can-table", str(BENCHES / "servo-can.toml")], "| "),
                                (["modbus-map", str(BENCHES / "servo-modbus.toml")], "| "),
                                (["modbus-map", str(BENCHES / "servo-modbus.toml"), "--csv"], "encoder_count")):
            done = run(*arguments)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(part, done.stdout)
        self.assertEqual(run("dbc", str(BENCHES / "servo-can.toml"), "--bus", "2").returncode, 2)
        self.assertEqual(run("dbc", "no-such-bench").returncode, 2)

    # Catches: a status that keeps the other ways in to itself.
    def test_status_lists_every_transport(self):
        text, link_of = multicast("true")
        text += "\n[modbus]\nport = 0\nallow_writes = true\n"
        with Server(text=text) as server:
            self.control(link_of(server))
            link = "tcp:%s:%d" % server.address
            can, modbus_, tcp = json.loads(run("status", "--json", "--link", link).stdout)["transports"]
            self.assertEqual((tcp["name"], tcp["state"]), ("tcp %s:%d" % server.address, "up"))
            self.assertEqual((can["name"], can["state"]), ("can " + server.ready["can"][0], "up"))
            self.assertGreaterEqual(can["counts"]["commands"], 1024)
            self.assertEqual((modbus_["name"], modbus_["state"]), ("modbus " + server.ready["modbus"], "up"))
            self.assertRegex(run("status", "--link", link).stdout, r"(?m)^can udp_multicast:.*: up\n  sent \d+,")

    # Catches: a subcommand that --help does not list.
    def test_the_help_lists_every_interface_command(self):
        text = run("--help").stdout
        for name in ("dbc", "can-table", "modbus-map", "can-log", "can ", "export"):
            self.assertIn(f"  {name}", text)
        self.assertIn("can:BACKEND:CHANNEL", run("control", "--help").stdout)
        self.assertIn("IFACE", run("can", "check", "--help").stdout)
        self.assertIn("candump", run("export", "--help").stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
