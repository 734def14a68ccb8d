"""An installation of the build, used as a stranger would: cc with pkg-config, CMake's find_package, the static library."""
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "helpers"))
from wire_client import PATIENCE_S, REPOSITORY, SERVER  # noqa: E402

BUILD = SERVER.parent.parent
EXAMPLES = REPOSITORY / "clients/examples"
SPINS = "147.368 rad/s at 0.842 A"  # 12 V on the motor of dc-a-voltage: K_T i = f w, 12 V = R i + K_T w


def run(*command, cwd, code=(0,)):
    """Where no variable, no current folder and no file of the checkout helps; its output."""
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          cwd=cwd, timeout=4 * PATIENCE_S, check=False,
                          env={name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ})
    if done.returncode not in code:
        raise AssertionError(f"{shlex.join(map(str, command))} ended with {done.returncode}:\n{done.stdout}")
    return done.stdout


class Install(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-install-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.prefix = cls.folder / "usr"
        run("cmake", "--install", BUILD, "--prefix", cls.prefix, cwd=cls.folder)
        [cls.libraries] = {file.parent for file in cls.prefix.rglob("libdrivebench.so")}
        for source in EXAMPLES.iterdir():
            shutil.copy(source, cls.folder)

    def flags(self, *options):
        pc = self.libraries / "pkgconfig"
        return run("env", f"PKG_CONFIG_PATH={pc}", "pkg-config", *options, "drivebench",
                   cwd=self.folder).split()

    # Catches: a header that only C++ or only the checkout can read, flags that find no library, a bench that is found
    # only from the checkout.
    def test_cc_and_pkg_config_build_the_examples_in_c(self):
        for source, says in (("blink.c", SPINS), ("foc.c", "q current"), ("six_step.c", ", 0 without a crossing"),
                             ("six_step_gates.c", ", 0 without a crossing")):
            run("cc", "-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O1", source, "-o", "example", *self.flags("--cflags", "--libs"),
                f"-Wl,-rpath,{self.libraries}", "-lm", cwd=self.folder)
            self.assertIn(says, run("./example", cwd=self.folder))

    # Catches: a static library without one of its parts.
    def test_the_static_library_needs_no_other_file_of_ours(self):
        private = self.flags("--libs", "--static")
        run("cc", "blink.c", "-o", "blink", *self.flags("--cflags"), self.libraries / "libdrivebench.a",
            *(flag for flag in private if flag != "-ldrivebench"), f"-Wl,-rpath,{self.libraries}", cwd=self.folder)
        bench = self.prefix / "share/drivebench/benches/dc-a-voltage.toml"
        self.assertIn(SPINS, run("./blink", f"inproc:{bench}", cwd=self.folder))
        self.assertNotIn("libdrivebench.so", run("ldd", "./blink", cwd=self.folder))

    # Catches: a package for CMake that names files of the build, and a C++ header that needs more than C++20.
    def test_find_package_builds_the_example_in_c_plus_plus(self):
        (self.folder / "CMakeLists.txt").write_text("""cmake_minimum_required(VERSION 3.16)
project(stranger LANGUAGES CXX)
find_package(drivebench 0.1 REQUIRED)
add_executable(half_turn half_turn.cpp)
target_compile_features(half_turn PRIVATE cxx_std_20)
target_compile_options(half_turn PRIVATE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror)
target_link_libraries(half_turn PRIVATE drivebench::drivebench)
""", encoding="utf-8")
        run("cmake", "-S", ".", "-B", "out", f"-DCMAKE_PREFIX_PATH={self.prefix}", cwd=self.folder)
        run("cmake", "--build", "out", cwd=self.folder)
        self.assertIn("turned by 3.142 rad of 3.142", run("out/half_turn", "inproc:dc-a-servo", cwd=self.folder))

    # Catches: a library that shows its inside, where it meets that of the program.
    def test_the_libraries_show_the_abi_alone(self):
        for library, prefix in (("libdrivebench.so", "drivebench_"), ("libdrivebench-inproc.so.1", "drivebench_inproc")):
            shown = run("nm", "-D", "--defined-only", self.libraries / library, cwd=self.folder).splitlines()
            names = [line.split()[-1] for line in shown]
            self.assertTrue(names)
            self.assertEqual([name for name in names if not name.startswith(prefix)], [])

    # Catches: a library in process that brings protobuf, whose second copy would end the program.
    def test_the_bench_in_process_has_no_protobuf(self):
        self.assertNotIn("protobuf", run("ldd", self.libraries / "libdrivebench-inproc.so.1", cwd=self.folder))

    # Catches: programs that find neither each other nor their benches once they are installed.
    def test_installed_programs_know_the_benches_by_name(self):
        # A busy machine is not real-time valid, which is no fault of the installation: code 1.
        said = run(self.prefix / "bin/drivebench", "demo", "--json", cwd=self.folder, code=(0, 1))
        self.assertRegex(said, r'"replay": \{\s*"equal": true')

    # Catches: an installation without the library in process that crashes or says nothing.
    def test_without_the_library_in_process_the_sentence_names_it(self):
        alone = self.folder / "alone"
        alone.mkdir()
        for file in self.libraries.glob("libdrivebench.so*"):
            shutil.copy(file, alone, follow_symlinks=False)
        run("cc", "blink.c", "-o", "lonely", *self.flags("--cflags"), f"-L{alone}", "-ldrivebench", f"-Wl,-rpath,{alone}", cwd=self.folder)
        said = run("./lonely", f"inproc:{self.prefix}/share/drivebench/benches/dc-a-voltage.toml", cwd=self.folder, code=(1,))
        self.assertIn("inproc: needs the library libdrivebench-inproc.so.1", said)


if __name__ == "__main__":
    unittest.main(verbosity=2)
