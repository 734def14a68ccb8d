#!/usr/bin/python3
"""`drivebench web` against strangers: forged names, wrong tokens, malformed and oversized messages, floods, slow readers; and
its metrics, which a strict reader accepts."""
import base64
import json
import pathlib
import re
import socket
import subprocess
import sys
import unittest

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "helpers"))
from command_test import USAGE, CommandTest
from web_client import PAGE, PING, PONG, TEXT, Gateway, Refused
from wire_client import BENCHES, frame, pb
from wire_test import until

TOKEN = "0123456789abcdef-of-the-gateway"
METRIC = re.compile(r'([a-z_:][a-z0-9_:]*)(?:\{((?:[a-z_][a-z0-9_]*="(?:[^"\\\n]|\\["\\n])*",?)+)\})? (-?[0-9.e+-]+|NaN|[+-]Inf)')


def samples_of(text):
    """Values by name and labels. Stricter than Prometheus: help, type and values of a family stand together, once."""
    if not text.endswith("\n"):
        raise AssertionError("no newline at the end")
    found, family, kind, seen = {}, None, None, set()
    for line in text.splitlines():
        if line.startswith("# HELP "):
            family, kind = line.split(" ")[2], None
            if family in seen or not line.endswith("."):
                raise AssertionError(line)
            seen.add(family)
        elif line.startswith("# TYPE "):
            _, _, name, kind = line.split(" ")
            if name != family or kind not in ("counter", "gauge", "histogram") or (kind == "counter") != name.endswith("_total"):
                raise AssertionError(line)
        else:
            match = METRIC.fullmatch(line)
            of_family = match and (match[1] == family or (kind == "histogram" and match[1] in [family + end for end in ("_bucket", "_sum", "_count")]))
            if not of_family or kind is None or (match[1], match[2]) in found:
                raise AssertionError(line)
            found[match[1], match[2]] = float(match[3])
    return found


class GatewayTest(CommandTest):
    def gateway(self, *options, server=None, **more):
        gateway = Gateway(server, *options, **more)
        self.addCleanup(gateway.__exit__)
        return gateway

    def certificate(self):
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-keyout",
                        "key.pem", "-out", "certificate.pem", "-subj", "/CN=bench", "-days", "30"], cwd=self.folder, check=True,
                       capture_output=True)
        (self.folder / "token").write_text(TOKEN + "\n", encoding="utf-8")
        return ("--certificate", self.folder / "certificate.pem", "--key", self.folder / "key.pem", "--browser-token",
                self.folder / "token")


class Start(GatewayTest):
    def refused(self, *options):
        return self.drivebench("web", *options, code=USAGE).stderr

    def test_web_02_an_address_for_others_needs_tls_and_a_token(self):
        """Catches: a gateway that serves a network without TLS or without a token."""
        tls = self.certificate()
        for options in ((), tls[:4], tls[4:]):
            said = self.refused("--listen", "0.0.0.0:0", *options)
            self.assertSays(said, "--listen 0.0.0.0:0", "--certificate, --key and --browser-token")

    def test_wrong_options_are_named_with_value_and_rule(self):
        """Catches: a mistake on the command line that ends in a stack trace, in a default or in another option's name."""
        tls = self.certificate()
        (self.folder / "short").write_text("abc\n", encoding="utf-8")
        self.assertSays(self.refused("--listen", "bench:80"), "--listen bench:80", "IP address")
        self.assertSays(self.refused("--listen", "127.0.0.1:70000"), "--listen 127.0.0.1:70000", "0 to 65535")
        self.assertSays(self.refused(*tls[:2]), "--certificate and --key")
        self.assertSays(self.refused("--browser-token", "short"), "--browser-token", "16 characters")
        self.assertSays(self.refused("--browser-token", "nowhere"), "--browser-token nowhere")
        self.assertSays(self.refused(*tls[:2], "--key", tls[5]), "--key", str(tls[5]))
        self.assertSays(self.refused("--link", "http://bench"), "'http://bench' is not an address")

    def test_a_port_in_use_is_said(self):
        """Catches: a gateway that ends in silence, or shares the port of another."""
        first = self.gateway(server=self.server("--mode", "lockstep"))
        self.assertSays(self.refused("--listen", f"127.0.0.1:{first.port}"), f"--listen 127.0.0.1:{first.port}", "in use")


class Door(GatewayTest):
    def setUp(self):
        super().setUp()
        self.bench = self.server("--mode", "lockstep")

    def test_web_01_a_foreign_host_or_origin_stays_outside(self):
        """Catches: DNS rebinding, and a WebSocket that another site's page opens."""
        gateway = self.gateway(server=self.bench)
        for path in ("/", "/metrics", "/health"):
            self.assertEqual(gateway.get(path, Host=f"evil.example:{gateway.port}")[0], 421)
            self.assertEqual(gateway.get(path, Origin="http://evil.example")[0], 403)
        for headers, status in (({"Host": "evil.example"}, "421"), ({"Origin": "http://evil.example"}, "403"),
                                ({"Origin": "null"}, "403"), ({"Origin": f"http://localhost:{gateway.port}"}, "403")):
            with self.assertRaisesRegex(Refused, status):
                gateway.browser(**headers)
        with gateway.browser(Origin=None) as browser:  # a program, not a browser
            self.assertEqual(browser.welcome.bench.name, "servo")
        refusals = samples_of(gateway.get("/metrics")[2])
        self.assertEqual(refusals["drivebench_web_refusals_total", 'reason="host"'], 4)
        self.assertEqual(refusals["drivebench_web_refusals_total", 'reason="origin"'], 6)

    def test_web_01_the_page_forbids_foreign_and_inline_scripts(self):
        """Catches: a page or an answer without its policy, and a file of the machine in place of the page's."""
        gateway = self.gateway(server=self.bench)
        status, headers, body = gateway.get("/")
        self.assertEqual(status, 200)
        self.assertIn("default-src 'none'; script-src 'self'", headers["Content-Security-Policy"])
        self.assertEqual(headers["X-Content-Type-Options"], "nosniff")
        self.assertNotRegex(body, r"<script>|<style|\son[a-z]+=|https?://")
        for path in ("/../../etc/passwd", "/%2e%2e/page.js", "//page.js", "/page.js?x", "/etc/passwd"):
            self.assertEqual(gateway.get(path)[0], 404, path)
        self.assertEqual(gateway.get("/", method="POST")[0], 405)
        self.assertEqual(gateway.get("/", method="HEAD")[2], "")

    def test_web_02_tls_lets_in_those_with_the_token_alone(self):
        """Catches: a page, a socket or a metric that needs no token; a token that is asked for and not compared."""
        gateway = self.gateway(*self.certificate(), server=self.bench)
        wrong = {"Authorization": "Bearer " + TOKEN[:-1] + "X"}
        for path in ("/", "/metrics", "/health", "/bench", "/page.js"):
            status, headers, _ = gateway.get(path)
            self.assertEqual((status, headers["WWW-Authenticate"]), (401, 'Basic realm="drivebench"'))
        self.assertEqual(gateway.get("/", **wrong)[0], 401)
        for headers in ({}, wrong):
            with self.assertRaisesRegex(Refused, "401"):
                gateway.browser(**headers)
        basic = {"Authorization": "Basic " + base64.b64encode(f"anna:{TOKEN}".encode()).decode()}
        self.assertEqual(gateway.get("/", **basic)[0], 200)
        self.assertEqual(gateway.get("/metrics", Authorization=f"Bearer {TOKEN}")[0], 200)
        with gateway.browser(**basic) as browser:
            self.assertEqual(browser.newest().tick, 0)
        with self.assertRaisesRegex(Refused, "403"):
            gateway.browser(Origin="https://evil.example", **basic)

    def test_the_rights_are_those_of_the_server(self):
        """Catches: a gateway that gives a browser its own rights, or swallows a refusal."""
        gateway = self.gateway(server=self.bench)
        with self.bench.client() as other, gateway.browser() as browser:
            other.lease()
            self.assertEqual(browser.lease().refusal.code, pb.REFUSAL_OWNED)
            other.lease(pb.LeaseRequest.ACTION_RELEASE)
            self.assertEqual(browser.lease().WhichOneof("kind"), "done")
            self.assertEqual(browser.step(0, 1.0, 0.0).tick, 1)
            answer = browser.ask(write_parameter=pb.WriteParameter(name="machine.rotor_resistance_ohm", value=-1))
            self.assertEqual(answer.refusal.code, pb.REFUSAL_OUT_OF_RANGE)
        # The browser has gone: the lease is free again.
        with self.bench.client() as next_one:
            until(lambda: next_one.lease().WhichOneof("kind") == "done", "the lease of the browser")


class Abuse(GatewayTest):
    def setUp(self):
        super().setUp()
        self.bench = self.server("--mode", "lockstep")
        self.web = self.gateway(server=self.bench)

    def closed_with(self, browser):
        self.assertTrue(browser.is_closed())
        return browser.close_code, browser.close_reason

    def test_web_03_malformed_and_oversized_messages_end_that_browser_alone(self):
        """Catches: bytes that reach the bench in pieces, a message without a limit, and a neighbour that pays for them."""
        with self.web.browser() as neighbour:
            for bytes_, problem in ((b"", "at least one frame"), (b"\0\0", "in the length"), (b"\0\0\0\0", "empty"),
                                    (b"\0\0\0\5abc", "in a frame"), (b"\xff\xff\xff\xffabc", "longer")):
                browser = self.web.browser()
                browser.send_bytes(bytes_)
                code, reason = self.closed_with(browser)
                self.assertEqual(code, 1002)
                self.assertIn(problem, reason)
            browser = self.web.browser(hello=False)
            browser.send_frame(TEXT, b"hello")
            self.assertEqual(self.closed_with(browser), (1002, "before the welcome of the bench messages are binary"))
            browser = self.web.browser()
            browser.send_frame(TEXT, b"hello")  # which is no order of the drive
            self.assertEqual(json.loads(browser.read_frame()[1])["problem"], "the text is not JSON")
            self.assertEqual(browser.newest().tick, 0)
            browser = self.web.browser()
            browser.send_bytes(frame(b"x" * 65537))
            self.assertTrue(browser.is_closed())
            browser = self.web.browser()
            browser.send_frame(2, b"unmasked", masked=False)
            self.assertTrue(browser.is_closed())
            browser = self.web.browser()  # whole frames without a message: the server's own refusal
            browser.send_bytes(frame(b"\xff\xff\xff"))
            self.assertEqual(browser.receive().refusal.code, pb.REFUSAL_MALFORMED)
            self.assertEqual(neighbour.newest().tick, 0)
            neighbour.send_frame(PING, b"there?")
            self.assertEqual(neighbour.read_frame(), (PONG, b"there?"))

    def test_web_04_a_thousand_idle_sockets_keep_no_browser_out(self):
        """Catches: places that idle sockets fill, and memory that grows with them."""
        idle = []
        for _ in range(1000):
            try:
                sock = self.web.raw()
                sock.send(b"GET / HTTP/1.1\r\n")
                idle.append(sock)
            except ConnectionError:
                pass
        with self.web.browser() as browser:
            self.assertEqual(browser.newest().tick, 0)
            self.assertEqual(self.web.get("/health")[0], 200)
            connections = samples_of(self.web.get("/metrics")[2])["drivebench_web_connections", None]
            self.assertLessEqual(connections, 260)
        for each in idle:
            each.close()

    def test_web_04_browsers_beyond_the_limit_are_told(self):
        """Catches: WebSockets without a limit, each of which is a session of the server."""
        browsers = [self.web.browser(hello=False) for _ in range(64)]
        with self.assertRaisesRegex(Refused, "503"):
            self.web.browser()
        browsers.pop().close()
        until(lambda: samples_of(self.web.get("/metrics")[2])["drivebench_web_browsers", None] == 63, "a free place")
        with self.web.browser() as browser:
            self.assertEqual(browser.newest().tick, 0)
        for each in browsers:
            each.close()

    def test_a_request_that_breaks_http_ends_its_connection_alone(self):
        """Catches: a parser that waits for ever, or takes the process with it."""
        for bytes_ in (b"\x16\x03\x01\x02\x00", b"GET\r\n\r\n", b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\n\r\nhello",
                       b"GET / HTTP/1.1\r\nX: " + b"a" * 9000 + b"\r\n\r\n"):
            with self.web.raw() as sock:
                sock.sendall(bytes_)
                try:
                    while sock.recv(4096):
                        pass
                except ConnectionError:
                    pass
        self.assertEqual(self.web.get("/health")[0], 200)


class Going(GatewayTest):
    def test_what_the_browser_sends_to_a_bench_that_goes_hides_no_last_words(self):
        """Catches: a failed write that ends the session as if the browser had gone, before the bench's own end is read."""
        path = self.folder / "going.sock"
        with socket.socket(socket.AF_UNIX) as listening:
            listening.bind(str(path))
            listening.listen()
            browser = self.gateway(link=f"unix:{path}").browser(hello=False)
            self.addCleanup(browser.close)
            bench, _ = listening.accept()
            with bench:
                last_words = frame(pb.Envelope(notice=pb.Notice(message="the bench goes")).SerializeToString())
                bench.shutdown(socket.SHUT_RD)
                bench.sendall(last_words)
                browser.send_bytes(frame(b"\x08\x01"))
                self.assertEqual(browser.receive().notice.message, "the bench goes")
                self.assertTrue(browser.is_closed())
        self.assertEqual((browser.close_code, browser.close_reason), (1001, "the bench has ended the session"))


class Drive(GatewayTest):
    def test_a_browser_that_goes_ends_its_drive_in_order(self):
        """Catches: a session that ends with the gates on, which the bench latches as a loss of its controller, and a motor that is
        switched off at full frequency."""
        server = self.server("--mode", "lockstep")
        gateway = self.gateway(server=server)
        axis = {"axis": 0, "gates": "voltage", "constant": [0, 0, 0, 0], "boost": 10, "per_hz": 1, "frequency_hz": 20, "ramp_s": 0.5}
        with server.client() as other:
            latched = sum(each.bit for each in other.welcome.bench.faults if each.latched)
            browser = gateway.browser()
            browser.lease()
            browser.send_frame(TEXT, json.dumps({"op": "drive", "axes": [axis]}).encode())
            until(lambda: other.newest().speed_rad_s > 40, "the speed")
            browser.close()
            until(lambda: other.lease().WhichOneof("kind") == "done", "the lease of the browser")
            last = other.step(other.newest().tick, 0.0, 0.0)
        self.assertEqual(last.faults & latched, 0)
        self.assertLess(last.speed_rad_s, 20)


class Reports(GatewayTest):
    def test_metrics_are_those_of_the_bench(self):
        """Catches: a name, a type or a text that Prometheus does not read, and a number that is not the bench's."""
        server = self.server("--mode", "lockstep", config=BENCHES / "dynamometer.toml")
        gateway = self.gateway(server=server)
        with server.client() as client:
            client.lease()
            client.step(0, 1.0, 0.0)
            client.exchange(0)  # stale
            tick = client.step(1, 1.0, 0.0).tick
            name = client.welcome.bench.axes[0].name
            found = samples_of(gateway.get("/metrics")[2])
        self.assertEqual(found["drivebench_up", None], 1)
        self.assertEqual(found["drivebench_ticks_total", None], tick)
        self.assertEqual(found["drivebench_sessions", None], 2)
        self.assertEqual(found["drivebench_axis_owned", f'axis="{name}"'], 1)
        self.assertEqual(found["drivebench_axis_refused_commands_total", f'axis="{name}"'], 1)
        self.assertGreater(found["process_resident_memory_bytes", None], 1e6)
        self.assertGreater(found["drivebench_resident_memory_bytes", None], 1e6)
        self.assertEqual(self.histogram(found, "drivebench_exchange_seconds")[-1], ("+Inf", 2), "a refused exchange is none")
        self.assertNotIn(("drivebench_tick_lateness_seconds_count", None), found, "time is not paced in lockstep")
        status, headers, body = gateway.get("/health")
        self.assertEqual((status, headers["Content-Type"], json.loads(body)["status"]), (200, "application/json", "ok"))

    def histogram(self, found, name):
        """The buckets, which must rise to the count, with a sum that they allow."""
        buckets = [(labels.partition("=")[2].strip('"'), value) for (metric, labels), value in found.items() if metric == f"{name}_bucket"]
        edges = [float(edge.replace("+Inf", "inf")) for edge, _ in buckets]
        counts = [count for _, count in buckets]
        self.assertEqual((len(buckets), edges, counts), (32, sorted(edges), sorted(counts)))
        self.assertEqual((edges[0], edges[1], edges[-1]), (125e-9, 250e-9, float("inf")))
        self.assertEqual(found[f"{name}_count", None], counts[-1])
        each = [count - before for count, before in zip(counts, [0, *counts])]
        self.assertLessEqual(sum(n * edge / 2 for n, edge in zip(each[1:-1], edges[1:-1])), found[f"{name}_sum", None])
        if each[-1] == 0:
            self.assertLessEqual(found[f"{name}_sum", None], sum(n * edge for n, edge in zip(each[:-1], edges[:-1])))
        return buckets

    def test_latenesses_are_a_histogram_in_real_time(self):
        """Catches: buckets that are not cumulative, edges in other units, a tick without a bucket, a sum of other ticks."""
        gateway = self.gateway(server=self.server("--mode", "realtime"))
        found = samples_of(gateway.get("/metrics")[2])
        count = self.histogram(found, "drivebench_tick_lateness_seconds")[-1][1]
        self.assertGreaterEqual(count, found["drivebench_ticks_total", None])  # a tick counts before it runs
        self.assertGreater(count, 0)

    def test_a_lost_bench_is_reported_and_found_again(self):
        """Catches: metrics of a bench that is gone, and a gateway that needs a restart."""
        path = self.folder / "bench.sock"
        gateway = self.gateway(link=f"unix:{path}")
        status, _, body = gateway.get("/health")
        self.assertEqual((status, json.loads(body)["status"]), (503, "no bench"))
        self.assertEqual({value for (name, _), value in samples_of(gateway.get("/metrics")[2]).items() if name == "drivebench_up"}, {0})
        with self.server("--mode", "lockstep", "--unix", str(path)):
            until(lambda: gateway.get("/health")[0] == 200, "the bench")
            self.assertEqual(samples_of(gateway.get("/metrics")[2])["drivebench_up", None], 1)
        until(lambda: gateway.get("/health")[0] == 503, "the loss of the bench")

    def test_web_05_a_slow_browser_is_told_what_it_lost_and_slows_nobody(self):
        """Catches: a queue that grows with a slow browser, samples that are lost in silence, and a session that ends for it."""
        server = self.server("--mode", "free", config=BENCHES / "servo.toml")
        gateway = self.gateway(server=server)
        slow = gateway.browser(receive_buffer=4096)
        self.addCleanup(slow.close)
        slow.send(subscribe=pb.Subscribe(axis=0, decimation=1))
        with gateway.browser() as quick:
            before = quick.status().tick
            until(lambda: quick.status().tick > before + 2_000_000, "two million ticks")
        self.assertLess(gateway.memory_kib(), 64 * 1024)
        dropped = 0
        while dropped == 0:
            envelope = slow.receive()
            dropped = envelope.samples.dropped
        self.assertGreater(dropped, 0)
        self.assertGreater(slow.status().tick, before)


if __name__ == "__main__":
    if not PAGE.exists():
        print(f"SKIPPED: the page was not built (node and npm): no {PAGE}")
        sys.exit(77)
    unittest.main(verbosity=2)
