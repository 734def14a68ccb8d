"""The checker of the include law, on made-up trees: each test breaks one rule, and would catch a checker that no longer
sees it."""

import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import include_law  # noqa: E402


class IncludeLaw(unittest.TestCase):
    def found(self, files):
        """The violations of a tree in which each file holds the lines given for it; all other files exist and are empty."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for line in (line for lines in files.values() for line in lines):
                target = line.partition('"')[2].partition('"')[0]
                if target and target != "bench.pb.h":
                    self.write(root, target, "")
            for name, lines in files.items():
                self.write(root, name, "".join(f"#include {line}\n" for line in lines))
            return include_law.violations(root)

    def write(self, root, name, text):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)

    def assert_one(self, expected, files):
        found = self.found(files=files)
        self.assertEqual(len(found), 1, found)
        self.assertIn(expected, found[0])

    def test_a_lawful_tree_has_no_violation(self):
        files = {
            "plant/axis.hpp": ["<cmath>", "<Eigen/Dense>", '"plant/drive/drive.hpp"', '"protocols/signals/sample.hpp"'],
            "plant/drive/drive.hpp": ['"plant/windings.hpp"'],
            "protocols/framing.cpp": ['"bench.pb.h"', "<zlib.h>", '"protocols/can/frame.hpp"'],
            "server/main.cpp": ['"server/endpoints/transports.hpp"', "<sys/socket.h>"],
            "server/endpoints/tcp/session.hpp": ['"server/endpoints/deadline.hpp"', '"server/engine/engine.hpp"'],
            "server/engine/engine.hpp": ['"server/host/clock.hpp"', '"plant/axis.hpp"'],
            "clients/command/main.cpp": ['"clients/link/address.hpp"', '"clients/control/loop/run.hpp"'],
            "clients/control/loop/run.hpp": ['"clients/models/machine.hpp"', '"plant/math/trig.hpp"'],
            "clients/regression/checks/harmonics.cpp": ['"plant/math/phasor.hpp"'],
        }
        self.assertEqual(self.found(files=files), [])

    def test_the_file_and_the_line_are_named(self):
        self.assert_one("plant/axis.hpp:2: ", {"plant/axis.hpp": ["<cmath>", '"server/host/clock.hpp"']})

    def test_the_plant_includes_signals_alone(self):
        self.assert_one("plant may include plant and protocols/signals alone", {"plant/axis.hpp": ['"protocols/framing.hpp"']})
        self.assert_one("plant may not include bench.pb.h", {"plant/axis.hpp": ['"bench.pb.h"']})
        self.assert_one("plant may not include <unistd.h>", {"plant/axis.hpp": ["<unistd.h>"]})

    def test_of_the_plant_its_mathematics_alone_is_for_all(self):
        self.assert_one("clients may include clients and protocols and plant/math alone",
                        {"clients/control/loop/run.hpp": ['"plant/axis.hpp"']})
        self.assert_one("plant/math may include plant/math alone", {"plant/math/curve.hpp": ['"plant/problem.hpp"']})
        self.assert_one("plant/math may not include <Eigen/Dense>", {"plant/math/curve.hpp": ["<Eigen/Dense>"]})

    def test_protocols_include_themselves_alone(self):
        self.assert_one("protocols may include protocols alone", {"protocols/framing.hpp": ['"plant/axis.hpp"']})
        self.assert_one("protocols may not include <sys/socket.h>", {"protocols/framing.cpp": ["<sys/socket.h>"]})

    def test_a_costly_header_is_read_where_it_must(self):
        self.assert_one("<spdlog/spdlog.h> takes seconds", {"server/access/audit.cpp": ["<spdlog/spdlog.h>"]})
        self.assert_one("<CLI/CLI.hpp> takes seconds", {"clients/command/demo/demo.hpp": ["<CLI/CLI.hpp>"]})
        self.assertEqual(self.found(files={"server/host/logging/log.cpp": ["<spdlog/spdlog.h>"]}), [])

    def test_signals_include_the_standard_library_alone(self):
        self.assert_one("protocols/signals may not include <fmt/format.h>", {"protocols/signals/sample.hpp": ["<fmt/format.h>"]})
        self.assert_one("protocols/signals may include", {"protocols/signals/sample.hpp": ['"protocols/framing.hpp"']})

    def test_server_and_clients_do_not_include_each_other(self):
        self.assert_one("server may include", {"server/main.cpp": ['"clients/link/address.hpp"']})
        self.assert_one("clients may include", {"clients/link/address.hpp": ['"server/host/clock.hpp"']})
        self.assert_one("clients may include", {"clients/link/address.hpp": ['"plant/axis.hpp"']})

    def test_control_models_and_identification_include_no_link(self):
        for room in ("control", "models", "identification"):
            self.assert_one(f"clients/{room} may include", {f"clients/{room}/math/b.hpp": ['"clients/link/address.hpp"']})
        self.assert_one("clients/models may include", {"clients/models/machine.hpp": ['"clients/control/loop/run.hpp"']})
        self.assert_one("clients/link may include", {"clients/link/address.hpp": ['"clients/command/common/basics/json.hpp"']})

    def test_nothing_includes_tests(self):
        self.assert_one("nothing but tests may include tests", {"server/main.cpp": ['"tests/wire/server.hpp"']})

    def test_a_path_starts_at_the_root_and_ends_at_a_header(self):
        with tempfile.TemporaryDirectory() as folder:
            self.write(pathlib.Path(folder), "server/host/clock.cpp", '#include "clock.hpp"\n')
            self.write(pathlib.Path(folder), "server/host/clock.hpp", "")
            found = include_law.violations(pathlib.Path(folder))
        self.assertEqual(len(found), 1)
        self.assertIn('server/host/clock.cpp:1: "clock.hpp" is no file of the repository', found[0])
        self.assert_one("server/host/clock.cpp is no header", {"server/host/all.cpp": ['"server/host/clock.cpp"']})

    def test_no_room_includes_a_file_beside_it_or_above(self):
        self.assert_one("server/main.hpp stands above server/engine", {"server/engine/engine.hpp": ['"server/main.hpp"']})
        self.assert_one("plant/axis.hpp stands above", {"plant/machines/pm/pm.hpp": ['"plant/axis.hpp"']})
        self.assert_one(
            "server/endpoints/can/endpoint.hpp stands above",
            {"server/endpoints/can/buses/bus.hpp": ['"server/endpoints/can/endpoint.hpp"']},
        )

    def test_the_rooms_of_the_server_stand_in_order(self):
        self.assert_one(
            "server/bench stands below server/engine", {"server/bench/bench.hpp": ['"server/engine/engine.hpp"']}
        )
        self.assert_one("has no place in the order", {"server/misc/all.hpp": ["<vector>"]})

    def test_rooms_form_no_circle(self):
        self.assert_one(
            "the rooms of clients/command form a circle: demo > recording > demo",
            {
                "clients/command/demo/a.hpp": ['"clients/command/recording/b.hpp"'],
                "clients/command/recording/c.hpp": ['"clients/command/demo/d.hpp"'],
            },
        )
        self.assert_one(
            "clients/command/control/b.hpp:1 includes clients/command/recording/c.hpp",
            {
                "clients/command/demo/a.hpp": ['"clients/command/control/b.hpp"'],
                "clients/command/control/b.hpp": ['"clients/command/recording/c.hpp"'],
                "clients/command/recording/c.hpp": ['"clients/command/demo/a.hpp"'],
            },
        )

    def test_a_foundation_is_part_of_no_circle_either(self):
        self.assert_one(
            "the rooms of plant form a circle: drive > windings.hpp > drive",
            {"plant/windings.hpp": ['"plant/drive/legs.hpp"'], "plant/drive/legs.hpp": ['"plant/windings.hpp"']},
        )

    def test_two_circles_are_two_violations(self):
        found = self.found(
            files={
                "protocols/can/a.hpp": ['"protocols/mcap/b.hpp"', '"protocols/modbus/c.hpp"'],
                "protocols/mcap/b.hpp": ['"protocols/can/a.hpp"'],
                "protocols/modbus/c.hpp": ['"protocols/can/a.hpp"'],
            }
        )
        self.assertEqual(len(found), 2, found)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
