#!/usr/bin/env python3
"""The include law: the arrows between the top folders, and between the rooms inside each of them.

Usage: include_law.py [ROOT]. Prints each violation as file:line: rule, and ends with 1 if there is one."""

import pathlib
import re
import sys
from collections import namedtuple

# The folders that the files of each top folder may include. Tests may include everything.
TOPS = {
    "plant": ("plant", "protocols/signals"),
    "protocols": ("protocols",),
    "server": ("server", "plant", "protocols"),
    "clients": ("clients", "protocols", "plant/math"),
}
GENERATED = {"bench.pb.h": ("protocols", "server", "clients")}

# Folders that may include less than their top folder. Below clients these know no link and no command, and so no wire.
NARROWER = {
    "protocols/signals": ("protocols/signals",),
    "plant/math": ("plant/math",),
    "clients/models": ("clients/models", "plant/math", "protocols/signals"),
    "clients/control": ("clients/control", "clients/models", "plant/math", "protocols/signals", "protocols/nearest_name.hpp"),
    "clients/identification": ("clients/identification", "clients/models", "plant/math", "protocols/signals",
                               "protocols/number_text.hpp"),
    "clients/link": ("clients/link", "protocols"),
    "clients/regression": ("clients/regression", "plant/math", "protocols"),
}

# The headers allowed between < and >, where not all are.
STANDARD = re.compile(r"[a-z_0-9]+$")
SYSTEM = {
    "plant": re.compile(r"[a-z_0-9]+$|Eigen/"),
    "plant/math": STANDARD,
    "protocols/signals": STANDARD,
    "protocols": re.compile(r"(?!boost/|sys/socket|sys/un|netinet/|arpa/|netdb|openssl/|modbus/|spdlog/|thread|mutex)"),
}

# Headers that cost seconds in each file that includes them, and the files that may.
COSTLY = {
    "spdlog/": ("server/host/logging/log.cpp",),
    "toml++/": ("protocols/document.cpp",),
    "CLI/": ("protocols/pages", "server/command_line.cpp", "clients/command/common/line/command_line.hpp"),
    "boost/beast": ("clients/web/gateway",),
    "boost/multiprecision": ("clients/identification/math",),
}

# Rooms that stand in an order, low to high; in all other folders it is enough that the rooms form no circle. The files
# beside the rooms stand above them all.
ORDERED = {
    "server": ("host", "bench", "config", "inproc", "fmu", "pacing", "recording", "engine", "messages", "access", "experiments", "endpoints"),
    "clients/control": ("math", "gains", "moves", "loop", "estimators", "dc", "wound_dc", "induction", "synchronous",
                        "salient", "presets"),
    "clients/identification": ("math", "data", "motors", "refinement", "wiring"),
    "clients/regression": ("tables", "formulas", "checks", "suite", "shrink", "timing", "verdicts", "reports", "results"),
}

# Files beside rooms that the rooms may include. They count as rooms of their own in the search for circles.
FOUNDATIONS = {
    "plant/axis_parameters.hpp",
    "plant/axis_state.hpp",
    "plant/drive/phases.hpp",
    "plant/faults.hpp",
    "plant/injected_faults.hpp",
    "plant/problem.hpp",
    "plant/thermal.hpp",
    "plant/tick.hpp",
    "plant/windings.hpp",
    "plant/machines/field_winding.hpp",
    "protocols/can/frame.hpp",
    "protocols/nearest_name.hpp",
    "protocols/refusals.hpp",
    "protocols/text.hpp",
    "server/config/config.hpp",
    "server/host/wall_time.hpp",
    "server/config/grants.hpp",
    "server/config/strict_table.hpp",
    "server/config/words.hpp",
    "server/endpoints/deadline.hpp",
    "server/endpoints/log_limit.hpp",
    "server/endpoints/lost_peer.hpp",
    "server/endpoints/tcp/session/context.hpp",
    "server/endpoints/tcp/session/dialogue.hpp",
    "server/endpoints/tcp/session/refusal_log.hpp",
    "server/endpoints/transport_report.hpp",
}

# Files in a room that stand above all rooms: they put a machine together from its equations, the rows of parameters and
# the train, and no file can include them.
ABOVE = re.compile(r"plant/machines/[a-z_]+/[a-z_]+_kind\.cpp$")

Include = namedtuple("Include", "file line target angled")
LINE = re.compile(r'\s*#\s*include\s*(?:"([^"]+)"|<([^>]+)>)')


def includes_of(root):
    """All includes of the product's sources, in the order of the files."""
    found = []
    for top in TOPS:
        for path in sorted((root / top).rglob("*.[ch]pp")):
            name = path.relative_to(root).as_posix()
            for number, text in enumerate(path.read_text().splitlines(), 1):
                if match := LINE.match(text):
                    found.append(Include(name, number, match[1] or match[2], match[1] is None))
    return found


def within(name, place):
    """Whether a file is, or lies below, a place."""
    return name == place or name.startswith(place + "/")


def broken_alone(include, root):
    """The rule that an include breaks by itself, or None."""
    file, _, target, angled = include
    top = file.partition("/")[0]
    if angled:
        for costly, places in COSTLY.items():
            if target.startswith(costly) and not any(within(file, place) for place in places):
                return f"<{target}> takes seconds to read: only {' and '.join(places)} may include it"
        for folder in sorted(SYSTEM, key=len, reverse=True):
            if within(file, folder):
                return None if SYSTEM[folder].match(target) else f"{folder} may not include <{target}>"
        return None
    if target in GENERATED:
        return None if top in GENERATED[target] else f"{top} may not include {target}"
    if not (root / target).is_file():
        return f'"{target}" is no file of the repository; a path starts at its root'
    if target.endswith(".cpp"):
        return f"{target} is no header"
    if within(target, "tests"):
        return f"nothing but tests may include tests: {target}"
    if not any(within(target, allowed) for allowed in TOPS[top]):
        return f"{top} may include {' and '.join(TOPS[top])} alone: {target}"
    for folder, allowed in NARROWER.items():
        if within(file, folder) and not any(within(target, each) for each in allowed):
            return f"{folder} may include {' and '.join(allowed)} alone: {target}"
    return None


def upward(include):
    """The rule that an include breaks by running from a room to a file beside it or above, or None."""
    file, _, target, _ = include
    folder = target.rpartition("/")[0]
    if ABOVE.match(file):
        return None
    if within(file, folder) and file.rpartition("/")[0] != folder and target not in FOUNDATIONS:
        return f"a room may not include a file beside it: {target} stands above {file.rpartition('/')[0]}"
    return None


def node_of(name, folder):
    """The node of a file in a folder: its room, itself if it is a foundation, or the files above."""
    if ABOVE.match(name):
        return "files above"
    first, deeper, _ = name[len(folder) + 1 :].partition("/")
    if deeper or name in FOUNDATIONS:
        return first
    return "files above"


def out_of_order(include):
    file, _, target, _ = include
    for folder, rooms in ORDERED.items():
        if within(file, folder) and within(target, folder):
            source, destination = node_of(file, folder), node_of(target, folder)
            if source in rooms and destination in rooms and rooms.index(source) < rooms.index(destination):
                return f"{folder}/{source} stands below {folder}/{destination}: {target} ({' < '.join(rooms)})"
    return None


def unordered_rooms(root):
    """Rooms of an ordered folder that its order does not name."""
    for folder, rooms in ORDERED.items():
        if (root / folder).is_dir():
            for room in sorted(path for path in (root / folder).iterdir() if any(path.rglob("*.[ch]pp"))):
                if room.is_dir() and room.name not in rooms:
                    yield f"{folder}/{room.name}:1: has no place in the order of rooms ({' < '.join(rooms)})"


def shortest_circle(edges):
    """The shortest list of nodes that ends where it starts, or None. Among equals the first by name."""
    best = None
    for start in sorted(edges):
        paths = [[start]]
        seen = set()
        while paths:
            path = paths.pop(0)
            for after in sorted(edges.get(path[-1], {})):
                if after == start:
                    if best is None or len(path) < len(best):
                        best = path
                    paths = []
                    break
                if after not in seen:
                    seen.add(after)
                    paths.append(path + [after])
    return best and best + best[:1]


def circles(includes):
    """One violation for each circle of rooms that remains once the circles before it are cut."""
    folders = {}
    for include in includes:
        file, _, target, _ = include
        depth = 0
        for a, b in zip(file.split("/")[:-1], target.split("/")[:-1]):
            if a != b:
                break
            depth += 1
        if depth == 0:
            continue
        folder = "/".join(file.split("/")[:depth])
        source, destination = node_of(file, folder), node_of(target, folder)
        if source != destination:
            folders.setdefault(folder, {}).setdefault(source, {}).setdefault(destination, include)
    for folder, edges in sorted(folders.items()):
        while circle := shortest_circle(edges):
            links = [edges[a][b] for a, b in zip(circle, circle[1:])]
            steps = ", ".join(f"{link.file}:{link.line} includes {link.target}" for link in links)
            yield f"{links[0].file}:{links[0].line}: the rooms of {folder} form a circle: {' > '.join(circle)} ({steps})"
            del edges[circle[0]][circle[1]]


def violations(root):
    """All violations of the law below a root."""
    found = list(unordered_rooms(root))
    sound = []
    for include in includes_of(root):
        rule = broken_alone(include, root)
        if not rule and not include.angled and include.target not in GENERATED:
            rule = upward(include) or out_of_order(include)
            if not rule:
                sound.append(include)
        if rule:
            found.append(f"{include.file}:{include.line}: {rule}")
    return found + list(circles(sound))


def main(arguments):
    root = pathlib.Path(arguments[0] if arguments else pathlib.Path(__file__).resolve().parents[2])
    found = violations(root)
    for each in found:
        print(each)
    print(f"include law: {len(found) or 'no'} violation{'s' * (len(found) != 1)}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
