#!/usr/bin/python3
"""Searches for bytes that break a promise: every libFuzzer program of a build, as many at a time as there are CPUs.

    tests/fuzz/search.py BUILD-FOLDER MINUTES [TARGET...]

Findings lie in BUILD-FOLDER/fuzz/TARGET/findings, inputs that reached new code in .../found, with which the next search
begins. Exit 1 if anything was found, 2 if there is nothing to run."""
import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys
import time

CORPUS = pathlib.Path(__file__).resolve().parent / "corpus"
HANGS_AFTER_S = 10  # a second without a sanitizer on an idle machine
MEMORY_MIB = 1024  # 256 without a sanitizer

OPTIONS = {"ASAN_OPTIONS": "quarantine_size_mb=16:allocator_may_return_null=1", "UBSAN_OPTIONS": "print_stacktrace=1"}


class Search:
    """One program and its results."""

    def __init__(self, program, folder, seconds):
        self.target = program.name.removeprefix("fuzz_").removesuffix("_search")
        self.folder = folder / self.target
        self.program, self.seconds = program, seconds
        self.findings, self.code, self.stats = [], None, {}

    def run(self):
        """Searches on after a halt of the machine, which libFuzzer's clock takes for a hang."""
        (self.folder / "findings").mkdir(parents=True, exist_ok=True)
        (self.folder / "found").mkdir(exist_ok=True)
        end = time.monotonic() + self.seconds
        while True:
            found = self.run_once(max(1.0, end - time.monotonic()))
            waited = {finding for finding in found
                      if finding.name.startswith(("timeout-", "slow-unit-")) and not self.hangs(finding)}
            for finding in waited:
                finding.unlink()
            self.findings = sorted(found - waited)
            halted = any(finding.name.startswith("timeout-") for finding in waited)
            if self.findings or not halted:
                return self
            self.code = 0
            if time.monotonic() >= end:
                return self

    def run_once(self, seconds):
        findings, found = self.folder / "findings", self.folder / "found"
        before = set(findings.iterdir())
        with open(self.folder / "log", "w+", encoding="utf-8", errors="replace") as log:
            self.code = subprocess.run(
                [self.program, found, CORPUS / self.target, f"-max_total_time={seconds:.0f}", "-print_final_stats=1",
                 f"-timeout={HANGS_AFTER_S}", f"-rss_limit_mb={MEMORY_MIB}", "-max_len=65536",
                 f"-artifact_prefix={findings}/"],
                stdout=log, stderr=subprocess.STDOUT, env={**os.environ, **OPTIONS}, check=False).returncode
            log.seek(0)
            text = log.read()
        for name, value in re.findall(r"stat::(\w+):\s+(\d+)", text):
            self.stats[name] = self.stats.get(name, 0) + int(value)
        self.stats["coverage"] = int((re.findall(r" cov: (\d+)", text) or ["0"])[-1])
        return set(findings.iterdir()) - before

    def hangs(self, finding):
        """Whether these bytes alone take that much time of a CPU."""
        return subprocess.run(["prlimit", f"--cpu={HANGS_AFTER_S}", self.program, finding], stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL, check=False).returncode != 0

    def failed(self):
        return bool(self.findings) or self.code != 0

    def line(self):
        runs = self.stats.get("number_of_executed_units", 0)
        said = "nothing found"
        if self.failed():
            said = f"{len(self.findings)} found" if self.findings else f"ended with {self.code}, see {self.folder}/log"
        return (f"{self.target:14} {runs:12,} runs {runs / self.seconds:10,.0f} 1/s {self.stats['coverage']:7,} edges "
                f"{self.stats.get('new_units_added', 0):6,} new inputs  {said}")


def main():
    try:
        build, minutes, chosen = pathlib.Path(sys.argv[1]).resolve(), float(sys.argv[2]), set(sys.argv[3:])
        if not 0.0 < minutes <= 100_000.0:
            raise ValueError
    except (IndexError, ValueError):
        print(__doc__, file=sys.stderr)
        return 2
    searches = [Search(program, build / "fuzz", 60.0 * minutes) for program in sorted((build / "bin").glob("fuzz_*_search"))]
    unknown = chosen - {search.target for search in searches}
    searches = [search for search in searches if not chosen or search.target in chosen]
    if unknown or not searches:
        print(f"no such target in {build}/bin: {', '.join(sorted(unknown)) or 'none at all'}", file=sys.stderr)
        return 2
    workers = os.cpu_count() or 1
    rounds = -(-len(searches) // workers)
    print(f"{len(searches)} targets, {minutes:g} min each, {workers} at a time: {rounds * minutes:g} min", flush=True)
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        for search in pool.map(Search.run, searches):
            print(search.line(), flush=True)
    found = [finding for search in searches for finding in search.findings]
    for search in searches:
        for finding in search.findings:
            print(f"\n{finding}\n  what it does: {search.folder}/log\n  again: build/release/bin/fuzz_{search.target} {finding}")
    failed = sum(search.failed() for search in searches)
    print(f"\n{len(found)} finding{'' if len(found) == 1 else 's'}; {len(searches) - failed} of {len(searches)} targets without one")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
