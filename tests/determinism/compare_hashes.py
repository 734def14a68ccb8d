#!/usr/bin/python3
"""Runs every hash_probe_* of a folder and compares their output: the state of the bench, tick by tick.

hash_probe_arm64_* run in the emulator that the second argument names.
Builds with fused multiply-add (hash_probe_*_fused_*) must differ; if they did not, this test would prove nothing.
"""
import os
import pathlib
import platform
import subprocess
import sys

# Takes AVX2 and FMA away from the variants of sin, exp and so on that the C library chooses when a program starts.
OLD_CPU = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2_Usable,-FMA_Usable,-FMA4_Usable,-AVX2,-FMA,-FMA4"}


def cpu_flags():
    try:
        text = pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return set()
    return {word for line in text.splitlines() if line.startswith("flags") for word in line.split(":")[1].split()}


def start(*command, environment=None):
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=dict(os.environ, **(environment or {})))


def first_difference(lines, reference):
    for mine, other in zip(lines, reference):
        if mine != other:
            return f"differs first at tick {mine.split()[0]}"
    return "prints another number of lines" if len(lines) != len(reference) else None


def main(folder, emulator=None):
    probes = sorted(pathlib.Path(folder).glob("hash_probe_*"))
    names = {probe.name.removeprefix("hash_probe_"): probe for probe in probes}
    if "gcc_o0" not in names and "clang_o0" not in names:
        sys.exit(f"no probes in {folder}")
    if not {"avx2", "fma"} <= cpu_flags():
        for name in [name for name in names if "haswell" in name]:
            print(f"SKIPPED {name}: this CPU has no AVX2 and FMA")
            del names[name]
    kinds = ["gcc", "clang"] + (["arm64"] if platform.machine() == "x86_64" else [])
    for kind in kinds:
        if not any(name.startswith(kind) for name in names):
            print(f"SKIPPED every build with {kind}: its compiler was not there when the tests were configured")
    if emulator is None and names.pop("arm64_gcc_o2", None):
        print("SKIPPED arm64_gcc_o2: qemu-aarch64 was not there when the tests were configured")

    runs = {name: start(*([emulator] if "arm64" in name else []), probe) for name, probe in names.items()}
    for name in ("product", "clang_o2"):
        if name in names:
            runs[name + " without FMA in the C library"] = start(names[name], environment=OLD_CPU)
    printed = {name: run.communicate()[0].splitlines() for name, run in runs.items()}

    reference = "gcc_o0" if "gcc_o0" in printed else "clang_o0"
    bad = 0
    for name, lines in printed.items():
        difference = first_difference(lines, printed[reference])
        failed = runs[name].returncode != 0 or not lines
        fused = "fused" in name
        wrong = failed or (difference is None) == fused
        bad += wrong
        print(f"{'WRONG' if wrong else 'ok   '} {name}: "
              f"{lines[-1] if lines else 'printed nothing'}; {difference or 'equal to ' + reference}"
              f"{' (as it must)' if fused and difference else ''}{', failed' if failed else ''}")
    if len(printed) < 3:
        sys.exit("too few builds to compare")
    sys.exit(f"{bad} of {len(printed)} builds are wrong" if bad else 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
