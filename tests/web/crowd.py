#!/usr/bin/python3
"""Measures what 32 browsers at once cost the ticks of a bench at 8 kHz, against the bound of the crowd benchmark: late ticks of
10,000 at most 5 above those beside the same browsers at another server on this machine.

Usage: /usr/bin/python3 tests/web/crowd.py [EVERY]. Needs the release build. A browser is a WebSocket session of the gateway that reads
the eight signals of a scope, every EVERY-th tick (8, as the viewers of the crowd benchmark; 1 is what the page asks for): 32 tabs of chromium do not
fit beside a bench on two cores. One process at the lowest priority reads for all, because browsers are on other computers."""
import os
import pathlib
import selectors
import statistics
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "helpers"))
from frames import cpu_s, processes_below
from web_client import Gateway
from wire_client import BENCHES, REPOSITORY, Server, pb

BROWSERS = 32
SIGNALS = ["tick", "speed_rad_s", "i_a_a", "i_b_a", "u_a_v", "u_b_v", "torque_nm", "angle_rad"]
WINDOW_S = 4.0
ROUNDS = 7
MOST_STRANGE = 0.1
MORE_LATE = 5.0  # of 10,000 ticks: windows of one kind differ by as much, see tests/benchmark/crowd


class There:
    """What the viewers know of a gateway that another process has started."""

    tls = False

    def __init__(self, port):
        self.port = port

    raw = Gateway.raw
    browser = Gateway.browser


def view(port, every):
    """The process of the viewers: reads until its standard input ends, then says how many bytes came."""
    os.nice(19)
    gateway = There(port)
    selector = selectors.DefaultSelector()
    browsers = []
    for _ in range(BROWSERS):
        browser = gateway.browser()
        browser.send(subscribe=pb.Subscribe(axis=0, decimation=every, signals=SIGNALS))
        browser.socket.setblocking(False)
        selector.register(browser.socket, selectors.EVENT_READ)
        browsers.append(browser)
    selector.register(sys.stdin, selectors.EVENT_READ)
    print("ready", flush=True)
    count = 0
    while True:
        for key, _ in selector.select():
            if key.fileobj is sys.stdin:
                print(count, flush=True)
                return
            got = key.fileobj.recv(1 << 18)
            if not got:
                sys.exit("a browser lost its bench")
            count += len(got)
        time.sleep(0.005)


class Browsers:
    """At a gateway, for the `with` block; `bytes` came to them."""

    def __init__(self, gateway, every):
        command = [sys.executable, __file__, "--view", str(gateway.port), str(every)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        if self.process.stdout.readline() != "ready\n":
            raise AssertionError("the browsers do not come")
        self.bytes = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        out, _ = self.process.communicate(timeout=60)
        self.bytes = int(out or 0)


def busy_s():
    """What all programs of this machine have used, as far as it runs them, and what other machines on its host have taken."""
    words = pathlib.Path("/proc/stat").read_text(encoding="utf-8").splitlines()[0].split()[1:]
    user, nice, system, _idle, _wait, interrupts, soft, stolen = map(int, words[:8])
    return (user + nice + system + interrupts + soft + stolen) / os.sysconf("SC_CLK_TCK")


def own_s():
    """What this program and those that it has started have used."""
    return sum(map(cpu_s, processes_below(os.getpid()) | {os.getpid()}))


class Window:
    """Late ticks of 10,000 in a window, and the part of the machine that strangers took meanwhile."""

    def __init__(self, client):
        before, busy, own, begin = client.status(), busy_s(), own_s(), time.monotonic()
        time.sleep(WINDOW_S)
        after = client.status()
        self.late = 1e4 * (after.late_ticks - before.late_ticks) / (after.tick - before.tick)
        self.strange = max(busy_s() - busy - (own_s() - own), 0.0) / (time.monotonic() - begin) / os.cpu_count()


def median(windows):
    return statistics.median(each.late for each in windows)


def main(every):
    text = (BENCHES / "servo-realtime.toml").read_text(encoding="utf-8").replace("../motors/", f"{REPOSITORY}/configs/motors/")
    # The ticks of the other server shall cost nothing, only its clients.
    quiet = text.replace('pacer = "sleep+spin"', 'pacer = "sleep"').replace("priority = 80", "priority = 1")
    alone, beside, elsewhere, cost, size = [], [], [], [], []
    with Server(text=text, strict=True) as server, Gateway(server) as gateway:
        client = server.client()
        for _ in range(ROUNDS):
            alone.append(Window(client))
            with Browsers(gateway, every) as browsers:
                before, begin = cpu_s(gateway.process.pid), time.monotonic()
                beside.append(Window(client))
                cost.append((cpu_s(gateway.process.pid) - before) / (time.monotonic() - begin))
            size.append(browsers.bytes / 2**20)
            with Server(text=quiet, strict=True) as other, Gateway(other) as there, Browsers(there, every):
                elsewhere.append(Window(client))
        client.close()
    strange = statistics.median(each.strange for each in alone + beside + elsewhere)
    print(f"late ticks per 10,000: {median(beside):.1f} beside {BROWSERS} browsers that read {len(SIGNALS)} signals every {every} ticks; "
          f"{median(elsewhere):.1f} beside the same at another server; {median(alone):.1f} alone")
    print(f"gateway: {100 * statistics.median(cost):.0f} % of a core; {statistics.median(size):.1f} MiB came in a window; "
          f"other programs took {100 * strange:.0f} % of {os.cpu_count()} cores")
    if strange > MOST_STRANGE:
        print(f"not judged: that is more than {100 * MOST_STRANGE:.0f} %")
    elif median(beside) > median(elsewhere) + MORE_LATE:
        sys.exit(f"crowd: more than {MORE_LATE} above those at another server, the bound of the crowd benchmark")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--view"]:
        view(int(sys.argv[2]), int(sys.argv[3]))
    else:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 8)
