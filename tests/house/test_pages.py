"""What the programs write about themselves: man pages that man and mandoc accept, completions that bash and zsh use."""
import os
import pathlib
import pty
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "helpers"))
from help_text import examples, headings, help_of, rows, verbs  # noqa: E402
from wire_client import PATIENCE_S, REPOSITORY, SERVER  # noqa: E402

CLIENT = SERVER.parent / "drivebench"
NEEDED = ("bash", "zsh", "mandoc", "groff")
SHOW = r"""show() { printf '\074%s\076\n' "$*"; }"""  # in angle brackets, which the echo of this line has not


def run(*command, code=0, text=None, **options):
    done = subprocess.run([str(word) for word in command], input=text, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
                          **options)
    if done.returncode != code:
        raise AssertionError(f"{' '.join(map(str, command))} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout + done.stderr


class Shell:
    """An interactive shell in a terminal of 200 columns, in a folder with the file `one.mcap` and the folder `many`."""

    def __init__(self, folder, *command):
        self.command = command
        self.process, self.terminal = pty.fork()
        if self.process == 0:
            os.chdir(folder)
            os.execvpe(command[0], command, {"PATH": f"{SERVER.parent}:/usr/bin:/bin", "TERM": "dumb", "COLUMNS": "200", "LANG": "C.UTF-8"})

    def type(self, text):
        os.write(self.terminal, text.encode())

    def read_until(self, mark):
        said, end = "", time.monotonic() + PATIENCE_S
        while not re.search(mark, said):
            if not select.select([self.terminal], [], [], max(end - time.monotonic(), 0.0))[0]:
                raise AssertionError(f"{self.command[0]}: no {mark!r} in {said!r}")
            said += os.read(self.terminal, 65536).decode()
        return said

    def completed(self, line):
        """The line after the tab key, as the shell then runs it: `show` prints its arguments."""
        self.type(f"{line}\t\x01show \x05\n")  # to the start of the line, the word, to its end
        return re.search("<([^<>]*)>", self.read_until("<[^<>]*>"))[1].strip()

    def close(self):
        os.close(self.terminal)
        os.waitpid(self.process, 0)


class Pages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-pages-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.pages = cls.folder / "share"
        environment = {"SOURCE_DATE_EPOCH": "86400"}
        for program in (CLIENT, SERVER):
            run(program, "--write-pages", cls.pages, cwd=REPOSITORY, env=environment)
        cls.work = cls.folder / "work"
        (cls.work / "many").mkdir(parents=True)
        (cls.work / "one.mcap").write_bytes(b"")

    # Catches: a verb without a page, a page that lacks an option, a heading or an example of --help or tells another text.
    def test_every_verb_has_a_page_with_the_texts_of_help(self):
        found = {"-".join(("drivebench", *path)) + ".1": text for path, text in verbs()}
        self.assertEqual(set(found), {file.name for file in (self.pages / "man/man1").iterdir()})
        for page, text in {**found, "drivebench-server.8": help_of("drivebench-server")}.items():
            shown = " ".join(run("man", "-l", self.pages / f"man/man{page[-1]}" / page,
                                 env={"MANWIDTH": "200", "PATH": os.environ["PATH"], "LANG": "C.UTF-8"}).split())
            for name, said in rows(text):
                if name.startswith("-"):
                    self.assertIn(name, shown, page)
                self.assertIn(said, shown, page)
            for heading in headings(text):
                self.assertIn(heading.upper() if heading in ("Arguments", "Verbs") else heading, shown, page)
            for example in examples(text):
                self.assertIn(" ".join(example.split()), shown.partition(" EXAMPLES ")[2], page)

    # Catches: text that troff takes for a request, a macro that does not exist, a date that no program reads.
    def test_mandoc_and_groff_have_nothing_to_say_about_them(self):
        for page in (self.pages / "man").rglob("*.[18]"):
            self.assertEqual(run("mandoc", "-Tlint", "-W", "warning", page), "", page)
            self.assertEqual(run("groff", "-k", "-man", "-ww", "-z", "-Tutf8", page, env={"PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8"}), "", page)
            self.assertIn(" 1970-01-02 ", page.read_text(encoding="utf-8"))

    # Catches: verbs, options and words that bash does not get; a value or a verb of another program taken for a verb of ours.
    def test_bash_completes_verbs_options_and_values(self):
        shell = Shell(self.work, "bash", "--norc", "--noprofile", "-i")
        self.addCleanup(shell.close)
        shell.type(SHOW + "; bind 'set bell-style none'; . "
                   f"{self.pages}/bash-completion/completions/drivebench; PS1='\\$ '\n")
        self.check(shell)
        self.assertEqual(shell.completed("drivebench export --format=cand"), "drivebench export --format=candump")
        self.assertEqual(shell.completed("drivebench control --gain a=watch --li"), "drivebench control --gain a=watch --li")

    # Catches: the same in zsh, and a text of --help that ends a specification of zsh.
    def test_zsh_completes_verbs_options_and_values(self):
        shell = Shell(self.work, "zsh", "-f", "-i")
        self.addCleanup(shell.close)
        shell.type(f"fpath=({self.pages}/zsh/site-functions $fpath); autoload -U compinit; compinit -D; setopt no_beep no_auto_remove_slash; bindkey -e; PS1='$ '; {SHOW}\n")
        self.check(shell)

    def check(self, shell):
        for line, whole in (("drivebench doc", "drivebench doctor"),
                            ("drivebench new motor bl", "drivebench new motor bldc"),
                            ("drivebench watch --cou", "drivebench watch --count"),
                            ("drivebench watch --axis control --cou", "drivebench watch --axis control --count"),
                            ("drivebench export --format cand", "drivebench export --format candump"),
                            ("drivebench control --preset servo/pos", "drivebench control --preset servo/pos"),
                            ("drivebench control --preset exercise/9.", "drivebench control --preset exercise/9.9"),
                            ("drivebench watch --signals tick,encoder_co", "drivebench watch --signals tick,encoder_count"),
                            ("drivebench replay on", "drivebench replay one.mcap"),
                            ("drivebench dbc servo-mod", "drivebench dbc servo-modbus"),
                            ("drivebench demo --keep man", "drivebench demo --keep many/"),
                            ("drivebench serve servo-mod", "drivebench serve servo-modbus"),
                            ("drivebench serve servo --mode real", "drivebench serve servo --mode realtime"),
                            ("drivebench-server --print modbus-c", "drivebench-server --print modbus-csv"),
                            ("drivebench-server on", "drivebench-server one.mcap")):
            self.assertEqual(shell.completed(line), whole, shell.command[0])

    # Catches: a folder that cannot be written reported as done.
    def test_a_folder_that_cannot_be_written_is_refused(self):
        (self.folder / "file").write_text("")
        self.assertIn("--write-pages", run(CLIENT, "--write-pages", self.folder / "file", code=2))
        self.assertIn("--write-pages", run(SERVER, "--write-pages", self.folder / "file", code=2))


if __name__ == "__main__":
    if missing := [name for name in NEEDED if shutil.which(name) is None]:
        print("skipped: missing", *missing)
        sys.exit(77)
    unittest.main(verbosity=2)
