#!/usr/bin/python3
"""The search of `./bench fuzz`, with programs that imitate libFuzzer's."""
import pathlib
import subprocess
import tempfile
import unittest

SEARCH = pathlib.Path(__file__).resolve().parent / "search.py"

HARMLESS = """#!/bin/sh
echo "#12 NEW cov: 34 ft: 5"
echo "stat::number_of_executed_units: 1200"
echo "stat::new_units_added:         7"
"""
BROKEN = """#!/bin/sh
for word; do case $word in -artifact_prefix=*) echo bytes > "${word#-artifact_prefix=}crash-1";; esac; done
exit 77
"""
# The first search ends with a timeout; these bytes alone then need no time (HALTED) or too much of it (HANGING).
HALTED = """#!/bin/sh
if test -f "$1"; then exit 0; fi
for word; do case $word in -artifact_prefix=*) prefix=${word#-artifact_prefix=};; esac; done
echo "stat::number_of_executed_units: 600"
if test -f "$prefix../halted"; then exit 0; fi
echo bytes > "$prefix../halted"
echo bytes > "${prefix}timeout-1"
echo bytes > "${prefix}slow-unit-1"
exit 70
"""
HANGING = HALTED.replace('exit 0', 'kill -XCPU $$', 1)
NO_START = "#!/bin/sh\nexit 3\n"


class Search(unittest.TestCase):
    def search(self, programs, minutes="0.5", *targets):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        build = pathlib.Path(folder.name)
        (build / "bin").mkdir()
        for name, text in programs.items():
            program = build / "bin" / f"fuzz_{name}_search"
            program.write_text(text, encoding="utf-8")
            program.chmod(0o755)
        done = subprocess.run(["/usr/bin/python3", SEARCH, build, minutes, *targets], capture_output=True, text=True, timeout=60,
                              check=False)
        return done.returncode, done.stdout + done.stderr

    def test_nothing_found_is_0_with_a_line_for_each_target(self):
        """Catches: a target that was forgotten, or numbers of another one."""
        code, said = self.search({"curve": HARMLESS, "config": HARMLESS})
        self.assertEqual(code, 0, said)
        self.assertRegex(said, r"curve +1,200 runs +40 1/s +34 edges +7 new inputs  nothing found")
        self.assertIn("0 findings; 2 of 2 targets without one", said)

    def test_a_finding_is_1_and_named(self):
        """Catches: success after a crash, or a finding without its file."""
        code, said = self.search({"curve": BROKEN, "config": HARMLESS})
        self.assertEqual(code, 1)
        self.assertRegex(said, r"again: build/release/bin/fuzz_curve .*/fuzz/curve/findings/crash-1")
        self.assertIn("1 finding; 1 of 2 targets without one", said)

    def test_a_halt_of_the_machine_is_no_finding(self):
        """Catches: a busy machine taken for a hang, a search that ends there with time left; a hang taken for a halt."""
        code, said = self.search({"curve": HALTED})
        self.assertEqual(code, 0, said)
        self.assertRegex(said, r"curve +1,200 runs .* nothing found")
        code, said = self.search({"curve": HANGING})
        self.assertEqual(code, 1, said)
        self.assertRegex(said, r"again: .*/fuzz/curve/findings/timeout-1")

    def test_a_program_that_does_not_start_is_1(self):
        """Catches: a search that never ran and found nothing."""
        code, said = self.search({"curve": NO_START})
        self.assertEqual(code, 1)
        self.assertIn("ended with 3", said)

    def test_a_wrong_command_line_is_2(self):
        """Catches: a misspelt target that counts as searched."""
        for arguments in (({"curve": HARMLESS}, "1", "curves"), ({}, "1"), ({"curve": HARMLESS}, "0"), ({"curve": HARMLESS}, "nan"),
                          ({"curve": HARMLESS}, "long")):
            self.assertEqual(self.search(*arguments)[0], 2, arguments)


if __name__ == "__main__":
    unittest.main(verbosity=2)
