#!/usr/bin/python3
"""Makes tests/adversity/FAULTS.md from tests/adversity/rows.toml and the names of all tests in the sources.

    /usr/bin/python3 tests/adversity/table.py            writes it
    /usr/bin/python3 tests/adversity/table.py --check    exit 1 if the stored one differs, or a name is wrong

A test counts if the build knows it: a CMakeLists.txt names it or its file."""
import pathlib
import re
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
TESTS = HERE.parent
ROWS = HERE / "rows.toml"
TABLE = HERE / "FAULTS.md"

GTEST = re.compile(r"^(?:TYPED_)?TEST(?:_[FP])?\(\s*(\w+)\s*,\s*(\w+)\s*\)", re.MULTILINE)
PYTHON = re.compile(r"^    def (test_\w+)\(", re.MULTILINE)
CTEST = re.compile(r"add_test\(NAME ([\w.]+)|drivebench_script\(([\w.]+) ")
FUZZ = re.compile(r"^drivebench_fuzz\((\w+) ", re.MULTILINE)

HEAD = """# Faults and abuse, and the tests that prove them

Made by `/usr/bin/python3 tests/adversity/table.py` from the names of the tests and [`rows.toml`](rows.toml); a test compares. A
test that proves a row has its ID in its name: `TEST(Bench, CMD_06_...)`, `def test_cmd_06_...`.

*differs:* where the catalogue of faults behind the rows requires another behaviour, and why the bench differs.
**proved**: by the tests named; **partly**: except for the part behind *open*; **missing**: no test yet; **not here**: cannot be
tested in this suite, with the reason.
"""


def names_of_tests():
    """Every test that the build runs, by its name."""
    known_to_cmake = "\n".join(file.read_text(encoding="utf-8") for file in TESTS.rglob("CMakeLists.txt"))
    names = set()
    for pattern, suffix in ((GTEST, ".cpp"), (PYTHON, ".py")):
        for file in TESTS.rglob("*" + suffix):
            if "node_modules" in file.parts or file.name not in known_to_cmake:
                continue
            for match in pattern.findall(file.read_text(encoding="utf-8")):
                names.add(match if isinstance(match, str) else ".".join(match))
    names.update(first or second for first, second in CTEST.findall(known_to_cmake))
    names.update("Fuzz." + target for target in FUZZ.findall(known_to_cmake))
    return names


def ids_in(name, kinds):
    return {f"{kind.upper()}-{number}"
            for kind, number in re.findall(rf"(?<![A-Za-z0-9])({kinds})_(\d\d)(?=_)", name, re.IGNORECASE)}


def status_of(row, tests):
    if "not_here" in row:
        return "not here"
    if not tests:
        return "missing"
    return "partly" if "open" in row else "proved"


def make_table(sections, names):
    """The text of the table, and the problems of the rows and names."""
    problems = []
    rows = [row for section in sections for row in section["rows"]]
    proofs = {row["id"]: set(row.get("by", [])) for row in rows}
    if len(proofs) != len(rows):
        problems.append("an ID stands in two rows")
    kinds = "|".join(sorted({row["id"].split("-")[0] for row in rows}))
    for name in sorted(names):
        for row in ids_in(name, kinds):
            if row in proofs:
                proofs[row].add(name)
            else:
                problems.append(f"{name}: there is no row {row}")
    for row in rows:
        for name in set(row.get("by", [])) - names:
            problems.append(f"{row['id']}: there is no test {name}")
        if "not_here" in row and proofs[row["id"]]:
            problems.append(f"{row['id']} cannot be tested here, and yet there is a test")
    counts = dict.fromkeys(("proved", "partly", "missing", "not here"), 0)
    text = ""
    for section in sections:
        text += f"\n## {section['title']}\n\n| ID | fault -> required behaviour | | tests |\n|---|---|---|---|\n"
        for row in section["rows"]:
            status = status_of(row, proofs[row["id"]])
            counts[status] += 1
            tests = [f"`{name}`" for name in sorted(proofs[row["id"]])]
            for key in ("open", "differs"):
                if key in row:
                    tests.append(f"*{key}:* {row[key]}")
            text += f"| {row['id']} | {row['must']} | {status} | {'<br>'.join(tests) or row.get('not_here', '')} |\n"
    summary = ", ".join(f"{number} {status}" for status, number in counts.items())
    return f"{HEAD}\n{len(rows)} rows: {summary}.\n{text}", problems


def main():
    sections = tomllib.loads(ROWS.read_text(encoding="utf-8"))["section"]
    text, problems = make_table(sections, names_of_tests())
    for problem in problems:
        print(problem)
    if sys.argv[1:] == ["--check"]:
        if not TABLE.exists() or TABLE.read_text(encoding="utf-8") != text:
            problems.append("")
            print("tests/adversity/FAULTS.md does not match the tests' names: run /usr/bin/python3 tests/adversity/table.py")
    elif not problems:
        TABLE.write_text(text, encoding="utf-8")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
