"""The Debian packages in a bare Debian 12: installed, used, upgraded with their data, removed without leftovers."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "helpers"))
from wire_client import PATIENCE_S, REPOSITORY, SERVER  # noqa: E402

BUILD = SERVER.parent.parent
SKIPPED = 77
NAMES = ("drivebench-doc", "python3-drivebench", "drivebench", "drivebench-server", "drivebench-data", "libdrivebench-dev", "libdrivebench1")
[VERSION] = re.findall(r"^project\(drivebench VERSION (\S+)", (REPOSITORY / "CMakeLists.txt").read_text(encoding="utf-8"), re.M)
THIS, NEXT = "2", "3"  # releases of Debian packages: this build's, and a later one of the same sources
SPINS = "147.368 rad/s at 0.842 A"
# What a package manager and a root without services change by themselves.
OWN_BUSINESS = re.compile(r"\./(var/(lib/(apt|dpkg|systemd|pam)|log|cache|mail|spool)|proc|sys|dev|run|tmp|root|packages|etc/(ld\.so|passwd|"
                          r"group|shadow|gshadow|subuid|subgid|\.pwd))")


def run(*command, code=(0,), seconds=10 * PATIENCE_S, **options):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          timeout=seconds, check=False, **options)
    if done.returncode not in code:
        raise AssertionError(f"{' '.join(map(str, command))} ended with {done.returncode}:\n{done.stdout[-3000:]}")
    return done.stdout


def mirror():
    """Where this machine gets Debian 12 from, or None."""
    try:
        listed = run("apt-get", "indextargets", "--format", "$(RELEASE) $(REPO_URI)").splitlines()
    except (AssertionError, FileNotFoundError):
        return None
    return next((line.split()[1] for line in listed if line.startswith("bookworm ")), None)


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-packages-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        cls.root = cls.folder / "debian"
        for release in (THIS, NEXT):
            build, library = f"(= {VERSION}-{release})", f"libdrivebench1 (= {VERSION}-{release})"
            needs = {"SERVER": f"adduser, drivebench-data {build}", "TOOLS": f"drivebench-data {build}, {library}",
                     "DEVELOPMENT": library, "PYTHON": f"python3 (>= 3.11), {library}"}
            run("cpack", "-G", "DEB", "-B", cls.folder / release, "-D", f"CPACK_DEBIAN_PACKAGE_RELEASE={release}",
                *[word for component, need in needs.items()
                  for word in ("-D", f"CPACK_DEBIAN_{component}_PACKAGE_DEPENDS={need}")], cwd=BUILD)
        run("debootstrap", "--variant=minbase", "bookworm", cls.root, mirror(), seconds=600)
        shutil.copy("/etc/resolv.conf", cls.root / "etc/resolv.conf")
        for release in (THIS, NEXT):
            shutil.copytree(cls.folder / release, cls.root / "packages" / release, ignore=shutil.ignore_patterns("_CPack*"))
        cls.inside("apt-get", "update")

    @classmethod
    def inside(cls, *command, code=(0,)):
        """Runs a command in the bare Debian, with a /proc of its own that goes with the command."""
        script = 'mount -t proc proc "$0/proc" && exec chroot "$0" sh -c "cd /root && exec \\"\\$@\\"" sh "$@"'
        environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "DEBIAN_FRONTEND": "noninteractive", "HOME": "/root",
                       **{name: value for name, value in os.environ.items() if name.endswith("_proxy")}}
        return run("unshare", "--mount", "--pid", "--fork", "sh", "-c", script, cls.root, *command, code=code, env=environment)

    def files(self):
        found = run("find", ".", "-xdev", cwd=self.root).splitlines()
        return {file for file in found if not OWN_BUSINESS.match(file)}

    def install(self, release, *names):
        """Installs packages of a build, all that there are unless named."""
        files = (self.root / "packages" / release).glob("*.deb")
        packages = [f"/packages/{release}/{file.name}" for file in files if not names or file.name.split("_")[0] in names]
        self.assertEqual(len(packages), len(names) or len(NAMES))
        return self.inside("apt-get", "install", "-y", "--no-install-recommends", "-o", "Dpkg::Options::=--force-confold", *packages)

    # Catches: what Debian's own checker calls an error or a warning: no change log, man page or trigger, a wrong place.
    def test_lintian_finds_nothing(self):
        packages = sorted((self.folder / THIS).glob("*.deb"))
        self.assertEqual(run("lintian", "--no-cfg", "--allow-root", "--fail-on", "error,warning", *packages), "")

    # Catches: an instruction that no builder takes, a package that the image lacks, a container that runs as root or without its bench.
    def test_the_containerfile_builds_and_its_image_serves(self):
        store = self.folder / "images"
        buildah = ("buildah", "--root", store / "root", "--runroot", store / "run", "--storage-driver", "vfs")
        base = run(*buildah, "from", "scratch").strip()  # the bare Debian in the place of the registry's
        run(*buildah, "add", base, self.root, "/")
        run(*buildah, "commit", "--rm", base, "localhost/bare")
        run(*buildah, "bud", "--isolation", "chroot", "--build-arg", "BASE=localhost/bare", "--file", REPOSITORY / "configs/packages/Containerfile",
            "--tag", "localhost/drivebench", self.folder / THIS, seconds=600)
        image = json.loads(run(*buildah, "inspect", "--type", "image", "localhost/drivebench"))["OCIv1"]["config"]
        self.assertEqual((image["User"], image["WorkingDir"]), ("drivebench", "/var/lib/drivebench"))
        container = run(*buildah, "from", "localhost/drivebench").strip()
        words = [*image["Entrypoint"], *image["Cmd"], "--port", "0", "--duration", "0.1", "--record", "run.mcap"]
        # By the exit codes: on a busy machine the last words of a container may be lost.
        inside = (*buildah, "run", "--isolation", "chroot", container, "--")
        run(*inside, *words, code=(0, 1))
        run(*inside, "drivebench-server", "--replay", "run.mcap")
        run(*inside, "sh", "-c", 'test "$(id -un)" = drivebench')

    def install_all_in_one(self):
        """drivebench as it was before the server and the benches had packages of their own."""
        root = self.root / "packages" / "before"
        for name in ("drivebench-server", "drivebench-data", "drivebench"):
            [package] = (self.folder / THIS).glob(f"{name}_*.deb")
            run("dpkg-deb", "--extract", package, root)
            run("dpkg-deb", "--control", package, self.folder / name)
            for place in ("share/doc", "share/lintian/overrides") if name != "drivebench" else ():
                run("rm", "-r", root / "usr" / place / name)
        shutil.copytree(self.folder / "drivebench-server", root / "DEBIAN")  # its scripts and files of configuration
        control = (self.folder / "drivebench/control").read_text(encoding="utf-8").replace(f"Version: {VERSION}-{THIS}", f"Version: {VERSION}-1")
        needs = re.sub(r" (drivebench-data|libdrivebench1) \([^)]*\),", "", control).replace("Depends:", "Depends: adduser,")
        (root / "DEBIAN/control").write_text(needs, encoding="utf-8")
        run("dpkg-deb", "-Znone", "--build", root, root.with_suffix(".deb"))
        self.inside("apt-get", "install", "-y", "--no-install-recommends", "/packages/before.deb")

    def check_that_each_side_works_alone(self):
        """A rack has the server without the tools, a desk the tools without the server."""
        self.install(THIS, "drivebench-server", "drivebench-data")
        self.assertIn("/etc/drivebench/bench.toml: ", self.inside("drivebench-server", "--check-config", "/etc/drivebench/bench.toml"))
        self.inside("drivebench-server", "/usr/share/drivebench/benches/dc-a-voltage.toml", "--mode", "free", "--port", "0", "--duration", "0.1")
        self.inside("dpkg", "--purge", "drivebench-server")
        self.install(THIS, "drivebench", "drivebench-data", "libdrivebench1")
        self.assertIn("counts", self.inside("drivebench", "control", "--link", "inproc:servo"))
        self.assertIn("package drivebench-server", self.inside("drivebench", "serve", code=(2,)))

    # Catches: a library, a file or a rule that a package forgets, a configuration or a recording lost by an upgrade, what
    # stays behind after a purge, a program that works only on the machine that built it.
    def test_a_bare_debian_installs_runs_upgrades_and_removes_them(self):
        self.inside("apt-get", "install", "-y", "--no-install-recommends", "adduser", "logrotate")
        before = self.files()
        self.check_that_each_side_works_alone()
        self.inside("dpkg", "--purge", "drivebench", "drivebench-data", "libdrivebench1")
        self.install_all_in_one()
        self.assertEqual(self.inside("dpkg-query", "-S", "/etc/drivebench/bench.toml").split(":")[0], "drivebench")
        self.install(THIS)
        self.assertEqual(self.inside("dpkg-query", "-S", "/etc/drivebench/bench.toml").split(":")[0], "drivebench-server")
        needed = self.inside("apt-mark", "showauto").split()

        # A busy machine is not real-time valid, which is no fault of the packages: code 1.
        said = self.inside("drivebench", "demo", "--json", code=(0, 1))
        self.assertRegex(said, r'"replay": \{\s*"equal": true')
        self.assertIn("/etc/drivebench/bench.toml: ", self.inside("drivebench-server", "--check-config", "/etc/drivebench/bench.toml"))
        self.assertRegex(self.inside("drivebench", "--version"), rf"drivebench {re.escape(VERSION)}, build ")
        [libraries] = {file.parent for file in (self.root / "usr/lib").rglob("libdrivebench.so")}
        run("cc", REPOSITORY / "clients/examples/blink.c", "-o", self.root / "root/blink", f"-I{self.root}/usr/include",
            f"-L{libraries}", "-ldrivebench", f"-Wl,-rpath-link,{libraries}")
        self.assertIn(SPINS, self.inside("/root/blink"))
        shutil.copy(REPOSITORY / "clients/python/examples/speed_loop.py", self.root / "root")
        self.assertIn("50.000 rad/s of 50.000", self.inside("python3", "/root/speed_loop.py", "inproc:dc-a-voltage"))
        self.assertEqual(self.inside("python3", "-c", "import importlib.metadata as m; print(m.version('drivebench'))"), f"{VERSION}\n")
        documents = self.root / "usr/share/doc/drivebench-doc"
        for name in ("README.md", "clients/README.md", "configs/OPERATION.md", "clients/python/examples/own_motor.py"):
            self.assertEqual((documents / name).read_bytes(), (REPOSITORY / name).read_bytes())
        dead = [f"{file.relative_to(documents)}: {link}" for file in documents.rglob("*.md")
                for link in re.findall(r"\]\(([^)#\s]+)", file.read_text(encoding="utf-8"))
                if "://" not in link and not (file.parent / link).exists()]
        self.assertEqual(dead, [])
        self.assertIn("drivebench:", (self.root / "etc/passwd").read_text(encoding="utf-8"))
        unit = (self.root / "usr/lib/systemd/system/drivebench-server.service").read_text(encoding="utf-8")
        self.assertIn("ExecStart=/usr/bin/drivebench-server /etc/drivebench/bench.toml", unit)

        log = self.root / "var/lib/drivebench/audit.jsonl"
        self.inside("install", "-d", "-o", "drivebench", "-g", "drivebench", "/var/lib/drivebench")
        log.write_text("{}\n", encoding="utf-8")
        self.inside("chown", "drivebench:drivebench", "/var/lib/drivebench/audit.jsonl")
        self.inside("logrotate", "--force", "--state", "/tmp/rotated", "/etc/logrotate.d/drivebench-server")
        self.assertEqual([file.name for file in log.parent.iterdir()], ["audit.jsonl.1"], "the server makes the new one, with its mode")
        shutil.rmtree(log.parent)

        bench = self.root / "etc/drivebench/bench.toml"
        bench.write_text(bench.read_text(encoding="utf-8") + "\n# ours\n", encoding="utf-8")
        work = self.root / "var/lib/drivebench"
        work.mkdir(parents=True, exist_ok=True)
        self.inside("drivebench-server", "/usr/share/drivebench/benches/dc-a-voltage.toml", "--mode", "free", "--port", "0",
                    "--duration", "0.1", "--record", "/var/lib/drivebench/run.mcap")
        recording = (work / "run.mcap").read_bytes()
        self.install(NEXT)
        self.assertEqual(self.inside("dpkg-query", "-W", "-f", "${Version}", "drivebench"), f"{VERSION}-{NEXT}")
        self.assertIn("# ours", bench.read_text(encoding="utf-8"))
        self.assertEqual((work / "run.mcap").read_bytes(), recording)
        self.assertIn("equal", self.inside("drivebench", "replay", "/var/lib/drivebench/run.mcap"))
        self.assertIn(SPINS, self.inside("/root/blink"))

        self.inside("dpkg", "--purge", *NAMES)
        self.assertEqual((work / "run.mcap").read_bytes(), recording)
        shutil.rmtree(work)
        self.inside("apt-get", "purge", "-y", *needed)
        self.assertEqual(sorted(self.files() - before), [])
        self.assertNotIn("drivebench", (self.root / "etc/passwd").read_text(encoding="utf-8"))


def reason_to_skip():
    if os.geteuid() != 0:
        return "a bare Debian needs root"
    if mirror() is None:
        return "apt names no mirror of Debian 12"
    if shutil.which("debootstrap") is None or shutil.which("dpkg-shlibdeps") is None:
        return "debootstrap or dpkg-dev is missing"
    for program in ("lintian", "buildah"):
        if shutil.which(program) is None:
            return f"{program} is missing"
    if subprocess.run(["unshare", "--mount", "--pid", "--fork", "true"], check=False).returncode != 0:
        return "this machine gives no namespaces"
    return None


if __name__ == "__main__":
    if reason := reason_to_skip():
        print("skipped:", reason)
        sys.exit(SKIPPED)
    unittest.main(verbosity=2)
