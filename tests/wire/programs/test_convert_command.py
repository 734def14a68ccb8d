#!/usr/bin/python3
"""drivebench convert: circuits, winding factors and frames, what they refuse, and what the README shows of them."""
import json
import math
import pathlib
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from command_test import USAGE, CommandTest
from wire_client import REPOSITORY

RESISTANCES = ["--stator-ohm", "1.85", "--rotor-ohm", "2.1"]
WINDINGS = [*RESISTANCES, "--stator", "0.244", "--rotor", "0.244", "--mutual", "0.225"]


class Convert(CommandTest):
    def converted(self, *arguments):
        return json.loads(self.drivebench("convert", *arguments, "--json").stdout)

    def test_one_machine_from_every_circuit(self):
        """P3-15. Catches: a form that gives another machine when it is read again, a reactance or a delta that is not
        brought to inductances and a star."""
        expected = self.converted("circuit", *WINDINGS)
        for name in ("gamma", "inverse_gamma", "equal_leakages"):
            form = expected[name]
            for reactances, share in ((False, 1.0), (True, 1.0), (False, 3.0)):
                unit = share * (2 * math.pi * 60 if reactances else 1.0)
                again = self.converted(
                    "circuit", "--stator-ohm", share * form["stator_resistance_ohm"], "--rotor-ohm", share * form["rotor_resistance_ohm"],
                    "--magnetizing", unit * form["mutual_inductance_h"], "--stator-leakage", unit * max(0.0, form["stator_leakage_h"]),
                    "--rotor-leakage", unit * max(0.0, form["rotor_leakage_h"]), *(["--hz", "60"] if reactances else []),
                    *(["--delta"] if share == 3.0 else []))
                for key, value in expected["equal_leakages"].items():
                    self.assertAlmostEqual(again["equal_leakages"][key], value, delta=1e-12)

    def test_windings_and_frames(self):
        """GEN-01, P3-02. Catches: slots counted in mechanical degrees, a pitch of whole turns, the two scalings swapped, a
        frame that turns the other way, six digits of a rounding error in the place of zero."""
        first = self.converted("winding", "--slots", "12", "--pitch", "5")[0]
        self.assertAlmostEqual(first["winding"], 0.9330, delta=5e-5)
        four_poles = self.converted("winding", "--slots", "48", "--poles", "4")[0]
        self.assertAlmostEqual(four_poles["winding"], 0.9577, delta=5e-5)
        loops = self.converted("winding", "--angles-deg", "-30,0,30")[0]
        self.assertAlmostEqual(loops["distribution"], 0.9107, delta=5e-5)
        shown = self.converted("frame", "--abc", "2,-1,-1", "--angle-deg", "90")
        for scaling, size in (("power_invariant", math.sqrt(6)), ("amplitude_invariant", 2.0)):
            for key, value in (("alpha", size), ("beta", 0.0), ("d", 0.0), ("q", -size)):
                self.assertAlmostEqual(shown[scaling][key], value, delta=1e-12)
        said = self.drivebench("convert", "frame", "--abc", "2,-1,-1", "--angle-deg", "90").stdout
        self.assertRegex(said, r"(?m)^power-invariant +2\.4495 +0 +0 +-2\.4495$")
        back = self.converted("frame", "--dq", "0,-2", "--angle-deg", "90", "--amplitude-invariant")
        for phase, value in zip(back["abc"], (2.0, -1.0, -1.0), strict=True):
            self.assertAlmostEqual(phase, value, delta=1e-12)

    def test_what_cannot_be_is_refused(self):
        """Catches: a machine that makes energy, half a circuit, slots that no phase can share."""
        for arguments, fact in ((["circuit", *RESISTANCES, "--stator", "1", "--rotor", "1", "--mutual", "1.2"], "must be positive"),
                                (["circuit", *RESISTANCES, "--stator", "1"], "belong together"),
                                (["circuit", *RESISTANCES], "--magnetizing"),
                                (["circuit", *WINDINGS, "--magnetizing", "1"], "or --magnetizing"),
                                (["circuit", *RESISTANCES, "--magnetizing", "1"], "must be positive"),
                                (["circuit", "--rotor-ohm", "1"], "--stator-ohm"),
                                (["winding", "--slots", "13"], "--slots is 13 but must be a multiple of 6"),
                                (["winding", "--slots", "12", "--pitch", "12"], "below two poles"),
                                (["winding", "--slots", "12", "--poles", "3"], "even"), (["winding"], "--angles-deg"),
                                (["winding", "--angles-deg", "0", "--pitch", "2"], "needs --slots"),
                                (["frame"], "give one of"), (["frame", "--dq", "1"], "--dq"), (["frame", "--abc", "nan,1,1"], "nan")):
            self.assertIn(fact, self.drivebench("convert", *arguments, code=USAGE).stderr)

    def test_the_readme_shows_what_is_printed(self):
        """Catches: an example that is no longer what the command prints."""
        told = (REPOSITORY / "clients/README.md").read_text(encoding="utf-8")
        circuit = [*RESISTANCES, "--magnetizing", "84.8", "--stator-leakage", "7.16", "--rotor-leakage", "7.16", "--hz", "60"]
        self.assertIn("drivebench convert circuit " + " ".join(circuit), told)
        for line in self.drivebench("convert", "circuit", *circuit).stdout.splitlines():
            self.assertIn(line, told)


if __name__ == "__main__":
    unittest.main(verbosity=2)
