#!/usr/bin/python3
"""The folder of reports of `drivebench web --reports` against hostile names, links and files."""
import json
import os
import sys
import unittest

from test_gateway import PAGE, USAGE, GatewayTest

REPORT = "<!doctype html><title>suite</title><script>document.title = 'taken'</script>"
MOST = 8 * 2**20


class ReportFolder(GatewayTest):
    def setUp(self):
        super().setUp()
        self.reports = self.folder / "reports"
        self.reports.mkdir()
        (self.reports / "suite.html").write_text(REPORT, encoding="utf-8")
        (self.folder / "secret.html").write_text("a secret", encoding="utf-8")
        self.bench = self.server("--mode", "lockstep")

    def names(self, gateway):
        return [each["name"] for each in json.loads(gateway.get("/reports")[2])]

    def test_web_07_no_name_reaches_beyond_the_folder(self):
        """Catches: a path that climbs, a link or a pipe that is followed, a file of another kind or a hidden one, a name that breaks a
        header or the list."""
        other = self.reports / "deeper"
        other.mkdir()
        (other / "inside.html").write_text("deeper", encoding="utf-8")
        (self.reports / "link.html").symlink_to(self.folder / "secret.html")
        (self.reports / "folder.html").symlink_to(other)
        (self.reports / "named.html").mkdir()
        os.mkfifo(self.reports / "pipe.html")
        for name in ("notes.txt", ".hidden.html", "a b.html", "<img src=x onerror=alert(1)>.html", "line\r\nSet-Cookie: a=b.html", "ä.html", "..html",
                     "x" * 201 + ".html", "html", ".html"):
            (self.reports / name).write_text("hostile", encoding="utf-8")
        gateway = self.gateway("--reports", self.reports, server=self.bench)
        self.assertEqual(self.names(gateway), ["suite.html"])
        for path in ("/reports/../secret.html", "/reports/..%2fsecret.html", "/reports/%2e%2e/secret.html", "/reports//etc/passwd",
                     "/reports/deeper/inside.html", "/reports/link.html", "/reports/folder.html", "/reports/folder.html/inside.html",
                     "/reports/named.html", "/reports/pipe.html", "/reports/notes.txt", "/reports/.hidden.html", "/reports/a%20b.html", "/reports/..html",
                     "/reports/", "/reports/.", "/reports/..", "/reports/suite.html/", "/reports/suite.html?x", "/reports/suite%2ehtml",
                     "/reports/SUITE.HTML", "/reports/suite.html%00.svg", "/reports/" + "x" * 201 + ".html", "/reportssuite.html"):
            status, _, body = gateway.get(path)
            self.assertEqual((status, "secret" in body), (404, False), path)

    def test_web_07_a_report_is_a_page_without_scripts_and_rights(self):
        """Catches: a report in the origin of the page, which could drive the bench, one that loads from elsewhere, a type that the
        browser guesses, a report for a site that is not this page or a visitor without the token."""
        (self.reports / "servo.json").write_text("{}", encoding="utf-8")
        (self.reports / "servo.svg").write_text("<svg/>", encoding="utf-8")
        gateway = self.gateway("--reports", self.reports, server=self.bench)
        for name, kind in (("suite.html", "text/html; charset=utf-8"), ("servo.json", "application/json"), ("servo.svg", "image/svg+xml")):
            status, headers, _ = gateway.get(f"/reports/{name}")
            self.assertEqual((status, headers["Content-Type"], headers["X-Content-Type-Options"]), (200, kind, "nosniff"))
            policies = headers.get_all("Content-Security-Policy")
            self.assertEqual(len(policies), 1)
            self.assertRegex(policies[0], r"^sandbox; default-src 'none'; ")
            self.assertNotRegex(policies[0], "script-src|allow-|connect-src")
        self.assertEqual(gateway.get("/reports/suite.html")[2], REPORT)
        for path in ("/reports", "/reports/suite.html"):
            self.assertEqual(gateway.get(path, Origin="http://evil.example")[0], 403)
            self.assertEqual(gateway.get(path, Host="evil.example")[0], 421)
            self.assertEqual(gateway.get(path, method="DELETE")[0], 405)
        closed = self.gateway("--reports", self.reports, *self.certificate(), server=self.bench)
        self.assertEqual(closed.get("/reports/suite.html")[0], 401)

    def test_web_07_size_and_number_are_bounded(self):
        """Catches: a report as large as its file that fills the memory, a list as long as the folder."""
        with open(self.reports / "large.html", "wb") as large:
            large.truncate(MOST + 1)
        with open(self.reports / "most.html", "wb") as most:
            most.truncate(MOST)
        gateway = self.gateway("--reports", self.reports, server=self.bench)
        too_large = {each["name"]: each["is_too_large"] for each in json.loads(gateway.get("/reports")[2])}
        self.assertEqual(too_large, {"large.html": True, "most.html": False, "suite.html": False})
        status, _, body = gateway.get("/reports/large.html")
        self.assertEqual((status, body), (413, "the report is larger than 8 MiB\n"))
        self.assertEqual(len(gateway.get("/reports/most.html")[2]), MOST)
        readers = []
        for _ in range(20):  # each asks and reads nothing
            readers.append(gateway.raw(receive_buffer=4096))
            readers[-1].sendall(f"GET /reports/most.html HTTP/1.1\r\nHost: 127.0.0.1:{gateway.port}\r\n\r\n".encode())
        statuses = sorted(each.recv(12).split()[1] for each in readers)
        self.assertEqual(statuses, [b"200"] * 4 + [b"503"] * 16)
        self.assertLess(gateway.memory_kib(), 150 * 1024)
        for each in readers:
            each.close()
        for number in range(700):
            path = self.reports / f"{number:03}.html"
            path.write_text("x", encoding="utf-8")
            os.utime(path, (1000 + number, 1000 + number))
        names = self.names(gateway)
        self.assertEqual((len(names), names[-1]), (500, "203.html"))

    def test_a_gateway_without_a_folder_has_no_reports(self):
        """Catches: a folder that is shown without being asked for, one that is missing and not named, a report that is read once and
        shown for ever."""
        gateway = self.gateway(server=self.bench)
        self.assertEqual(gateway.get("/reports")[::2], (200, "null"))
        self.assertEqual(gateway.get("/reports/suite.html")[0], 404)
        said = self.drivebench("web", "--reports", "nowhere", code=USAGE).stderr
        self.assertSays(said, "--reports nowhere", "no folder to read")
        said = self.drivebench("web", "--reports", self.reports / "suite.html", code=USAGE).stderr
        self.assertSays(said, "no folder to read")
        gateway = self.gateway("--reports", self.reports, server=self.bench)
        (self.reports / "suite.html").write_text("another", encoding="utf-8")
        self.assertEqual(gateway.get("/reports/suite.html")[2], "another")
        (self.reports / "suite.html").unlink()
        self.assertEqual((gateway.get("/reports/suite.html")[0], self.names(gateway)), (404, []))


if __name__ == "__main__":
    if not PAGE.exists():
        print(f"SKIPPED: the page was not built (node and npm): no {PAGE}")
        sys.exit(77)
    unittest.main(verbosity=2)
