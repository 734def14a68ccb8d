#!/usr/bin/python3
"""TLS on the TCP port: valid and refused certificates, and streams behind TLS. openssl makes the certificates here."""
import json
import pathlib
import select
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings

try:
    import google.protobuf  # noqa: F401
except ImportError:
    print("SKIPPED: python3-protobuf is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
from command_test import DRIVEBENCH
from wire_client import PATIENCE_S, Client, Closed, frame, pb
from wire_test import SERVO_TEXT, WireTest, until

AUTHORITY = """
[ca]
default_ca = here
[here]
database = index.txt
crlnumber = crlnumber
default_md = sha256
default_crl_days = 3650
certificate = ca.pem
private_key = ca.key
"""


class Certificates:
    """A folder with an authority, a server, and valid and invalid clients."""

    def __init__(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="drivebench-tls-"))
        for authority in ("ca", "stranger"):
            self.openssl("req", "-x509", *self.key(f"{authority}.key"), "-subj", f"/CN={authority}", "-days", "3650",
                         "-out", f"{authority}.pem")
        self.issue("server", extensions="subjectAltName=IP:127.0.0.1\nextendedKeyUsage=serverAuth")
        self.issue("anna")
        self.issue("foreign", authority="stranger")
        self.issue("old", at="2020-01-01")
        self.issue("early", at="2035-01-01")
        self.issue("machine", extensions="extendedKeyUsage=serverAuth")
        self.issue("gone")
        (self.folder / "index.txt").touch()
        (self.folder / "crlnumber").write_text("01\n", encoding="utf-8")
        (self.folder / "ca.cnf").write_text(AUTHORITY, encoding="utf-8")
        self.openssl("ca", "-config", "ca.cnf", "-revoke", "gone.pem")
        self.openssl("ca", "-config", "ca.cnf", "-gencrl", "-out", "crl.pem")

    @staticmethod
    def key(name):
        return "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", name

    def openssl(self, *arguments, at=None):
        pretend = ["faketime", at] if at else []
        subprocess.run([*pretend, "openssl", *arguments], cwd=self.folder, check=True, capture_output=True)

    def issue(self, name, authority="ca", extensions="extendedKeyUsage=clientAuth", at=None, subject=None):
        (self.folder / "extensions").write_text(extensions, encoding="utf-8")
        self.openssl("req", "-utf8", *self.key(f"{name}.key"), "-subj", f"/CN={subject or name}", "-out", "request")
        self.openssl("x509", "-req", "-in", "request", "-CA", f"{authority}.pem", "-CAkey", f"{authority}.key", "-CAcreateserial",
                     "-days", "3000" if at is None else "30", "-extfile", "extensions", "-out", f"{name}.pem", at=at)
        (self.folder / f"{name}.key").chmod(0o600)


class TlsTest(WireTest):
    @classmethod
    def setUpClass(cls):
        cls.made = Certificates()

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.made.folder, ignore_errors=True)

    def tls_server(self, more="", *options):
        folder = self.made.folder
        section = f'\n[tls]\ncertificate = "{folder}/server.pem"\nkey = "{folder}/server.key"\n{more}'
        audit = folder / f"audit-{sum(1 for _ in folder.glob('audit-*'))}"
        server = self.server(*options, text=SERVO_TEXT + section + f'\n[audit]\nfile = "{audit}"\n')
        server.audit = audit
        return server

    def mutual_server(self):
        folder = self.made.folder
        return self.tls_server(f'client_ca = "{folder}/ca.pem"\nclient_crl = "{folder}/crl.pem"\n')

    def assertAllRefusalsAreCounted(self, server, client, count):
        """The number of refused clients, also in the audit log, and not only those of which the log has a line; returns
        the reasons."""
        self.assertEqual(client.tcp_counts()["tls_refused"], count)
        return self.assertAudited(server.audit, "tls_refused", count)

    def assertCutOnce(self, server, why):
        self.assertEqual(self.assertAudited(server.audit, "limit", 1), [why])
        ended, = self.audited(server.audit, "session_ended")
        self.assertEqual((ended["subject"], ended["details"]["reason"]), ("anna", why))
        self.assertEqual([line["subject"] for line in self.audited(server.audit, "limit")], ["anna"])

    def context(self, name=None, authority="ca"):
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.load_verify_locations(self.made.folder / f"{authority}.pem")
        if name:
            context.load_cert_chain(self.made.folder / f"{name}.pem", self.made.folder / f"{name}.key")
        return context

    def tls_client(self, server, context, hello=True, **options):
        wrapped = context.wrap_socket(server.raw(**options), server_hostname="127.0.0.1")
        client = Client(wrapped, hello)
        self.addCleanup(client.close)
        return client

    def assertTurnedAway(self, server, context, why=None):
        # With TLS 1.3 a client learns the server's verdict on its certificate with its first read.
        with self.assertRaises((ssl.SSLError, ConnectionError, Closed)):
            self.tls_client(server, context)
        if why:
            until(lambda: why in server.errors(), why)


class Plain(TlsTest):
    def test_sec_03_a_run_behind_tls_is_the_same_run(self):
        """Catches: bytes that are lost, doubled or overtake each other behind TLS; an old protocol."""
        plain, door = self.server(), self.tls_server()
        expected, client = self.client(plain), self.tls_client(door, self.context())
        self.assertEqual(client.socket.version(), "TLSv1.3")
        for each in (expected, client):
            self.assertDone(each.lease())
            self.assertDone(each.ask(subscribe=pb.Subscribe(decimation=1)))
            for tick in range(500):
                each.step(tick, 5.0, -3.0)
        self.assertEqual(client.status().state_hash, expected.status().state_hash)
        seen = [s.tick for message in client.samples for s in message.samples]
        self.assertEqual(len(seen) + sum(message.dropped for message in client.samples), 500)
        client.close()
        until(lambda: self.tls_client(door, self.context()).lease().WhichOneof("kind") == "done", "the lease ends with the connection")
        self.assertEqual(door.stop(), 0)

    def test_sec_03_older_protocols_are_refused(self):
        """Catches: a server that takes a broken protocol."""
        server = self.tls_server()
        warnings.simplefilter("ignore", DeprecationWarning)
        for version in (ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_1):
            context = self.context()
            context.minimum_version = ssl.TLSVersion.TLSv1
            context.maximum_version = version
            context.set_ciphers("ALL:@SECLEVEL=0")
            self.assertTurnedAway(server, context)
        self.tls_client(server, self.context())

    def test_tcp_04_foreign_protocols_are_closed_before_tls(self):
        """Catches: plain text, other protocols or an SSLv2 hello that get through, or a line in the log for each."""
        server, began = self.tls_server(), time.monotonic()
        hello = pb.Envelope(id=1, hello=pb.Hello(protocol_min=1, protocol_max=1)).SerializeToString()
        for said in (len(hello).to_bytes(4, "big") + hello, b"GET / HTTP/1.1\r\n\r\n", b"\x80\x2e\x01\x00\x02" + bytes(41), b"SSH-2.0-x\r\n"):
            with server.raw() as stranger:
                stranger.sendall(said)
                try:
                    while stranger.recv(4096):  # at most an alert
                        pass
                except ConnectionResetError:
                    pass
        self.assertAllRefusalsAreCounted(server, self.tls_client(server, self.context()), 4)
        self.assertIn(server.errors().count(": no TLS: "), range(1, 2 + int(time.monotonic() - began) // 10), "a line in 10 s")

    def test_sec_05_limit_05_silent_handshakes_are_few_and_short(self):
        """Catches: peers that begin a handshake and take the places of all others, even forever, or delay them; a place
        too few or too many."""
        took_s = 2.0
        while took_s > 1.8:  # on so slow a machine the first handshakes have timed out
            server = self.tls_server()
            since = time.monotonic()
            silent = [server.raw() for _ in range(32)]
            for each in silent:
                self.addCleanup(each.close)
            good = self.tls_client(server, self.context())
            self.assertEqual(silent[0].recv(1), b"", "it made room")
            self.assertEqual(good.status().sessions, 1)
            took_s = time.monotonic() - since
        for each in silent[1:]:
            each.setblocking(False)
            with self.assertRaises(BlockingIOError, msg="has 2 s"):
                each.recv(1, socket.MSG_PEEK)
            each.settimeout(PATIENCE_S)
        connected = time.monotonic()
        for each in silent[1:]:
            self.assertEqual(each.recv(1), b"")
        self.assertLimitOf2s(since, connected)
        first, *others = self.assertAllRefusalsAreCounted(server, good, 32)
        self.assertIn("another client came", first)
        self.assertEqual(set(others), {"no handshake within 2 s"})

    def test_sec_05_a_flood_of_silent_peers_delays_no_handshake(self):
        """Catches: 200 silent peers of another address, always renewed, for which a client must wait or which take its place."""
        server = self.tls_server()
        over = threading.Event()

        def flood():
            crowd = [server.raw(source="127.0.0.2") for _ in range(200)]
            while not over.is_set():
                crowd.pop(0).close()
                crowd.append(server.raw(source="127.0.0.2"))
            for each in crowd:
                each.close()
        crowd = threading.Thread(target=flood)
        crowd.start()
        self.addCleanup(crowd.join)
        self.addCleanup(over.set)
        inside = self.tls_client(server, self.context())
        until(lambda: inside.tcp_counts()["tls_refused"] > 200, "the crowd is there")
        for _ in range(10):
            self.tls_client(server, self.context()).close()

    def test_tcp_10_a_reader_that_stops_is_cut_behind_tls_too(self):
        """Catches: a stream behind TLS that is fed forever; one that TLS cuts, so that the log does not name the client
        or says that it left."""
        server = self.mutual_server()
        owner = self.tls_client(server, self.context("anna"))
        deaf = self.tls_client(server, self.context("anna"), receive_buffer=4096)
        owner.lease()
        deaf.ask(subscribe=pb.Subscribe(decimation=1))
        began = time.monotonic()
        for tick in range(4000):  # more than the buffers hold
            owner.step(tick, 1.0)
        ended = time.monotonic()
        until(lambda: owner.status().sessions == 1, "the session is cut")
        self.assertLimitOf2s(began, ended)
        until(lambda: owner.tcp_counts()["cut"] > 0, "the cut is counted")
        self.assertEqual(owner.tcp_counts()["cut"], 1)
        self.assertCutOnce(server, "it took nothing for 2 s")

    def test_limit_03_a_session_that_is_cut_for_its_queue_is_counted_once(self):
        """Catches: a TLS layer that goes on sending, finds the peer deaf and counts the session again, without a name."""
        server = self.mutual_server()
        owner = self.tls_client(server, self.context("anna"))
        greedy = self.tls_client(server, self.context("anna"), receive_buffer=4096)
        request = frame(pb.Envelope(id=1, read_parameters=pb.ReadParameters()).SerializeToString())
        with self.assertRaises(OSError):  # when TLS gives up as well
            while True:
                greedy.send_bytes(request * 100)
        self.assertEqual(owner.tcp_counts()["cut"], 1)
        self.assertCutOnce(server, "too much waits for it")

    def test_limit_04_limit_05_a_pause_of_the_server_cuts_no_session(self):
        """Catches: limits that, when the process goes on, cut a client that did its part during the stop: read, said
        hello, sent the rest of a frame, or completed its handshake."""
        server = self.tls_server()
        owner, reader, half = (self.tls_client(server, self.context(), **options) for options in ({}, {"receive_buffer": 4096}, {}))
        owner.lease()
        reader.ask(subscribe=pb.Subscribe(decimation=1))
        for tick in range(2000):  # more than the buffers hold
            owner.step(tick, 1.0)
        silent = self.tls_client(server, self.context(), hello=False)
        shaking = self.context().wrap_socket(server.raw(), server_hostname="127.0.0.1", do_handshake_on_connect=False)
        self.addCleanup(shaking.close)
        shaking.setblocking(False)
        server.process.send_signal(signal.SIGSTOP)  # so that the server does not answer at once
        with self.assertRaises(ssl.SSLWantReadError):
            shaking.do_handshake()
        server.process.send_signal(signal.SIGCONT)
        select.select([shaking], [], [], PATIENCE_S)
        whole = frame(pb.Envelope(id=7, status_request=pb.StatusRequest()).SerializeToString())
        half.send_bytes(whole[:5])
        owner.step(2000, 1.0)
        server.process.send_signal(signal.SIGSTOP)
        half.send_bytes(whole[5:])
        hello = silent.send(hello=pb.Hello(protocol_min=1, protocol_max=1))
        shaking.do_handshake()
        reader.socket.settimeout(0.2)
        with self.assertRaises(TimeoutError):
            while True:
                reader.buffer += reader.socket.recv(1 << 16)
        time.sleep(2.3)
        server.process.send_signal(signal.SIGCONT)
        for each in (shaking, reader.socket):
            each.settimeout(PATIENCE_S)
        self.assertEqual(half.answer_to(7).WhichOneof("kind"), "status")
        self.assertEqual(silent.answer_to(hello).WhichOneof("kind"), "welcome")
        self.assertEqual(Client(shaking).newest().tick, 2001)
        self.assertEqual(reader.newest().tick, 2001)
        counts = owner.tcp_counts()
        self.assertEqual((counts["cut"], counts["tls_refused"], counts["sessions"]), (0, 0, 5))

    def test_a_refused_peer_that_does_not_close_is_not_counted_as_cut(self):
        """Catches: a limit that counts refused clients that are slow to leave."""
        server = self.tls_server()
        rude = self.tls_client(server, self.context(), hello=False)
        rude.send_bytes(b"GET ")
        self.assertRefused(rude.receive(), pb.REFUSAL_MALFORMED)
        time.sleep(1.5)  # longer than the server waits for the peer's close
        counts = self.tls_client(server, self.context()).tcp_counts()
        self.assertEqual((counts["malformed"], counts["cut"], counts["sessions"]), (1, 0, 1))
        self.assertEqual(self.audited(server.audit, "limit"), [])

    def test_cfg_07_unusable_files_are_refused(self):
        """Catches: a server that starts without the requested encryption, or with a key that every user can read."""
        folder = self.made.folder
        shutil.copy(folder / "server.key", folder / "open.key")
        (folder / "open.key").chmod(0o644)
        for more, said in ((f'certificate = "{folder}/server.pem"\nkey = "{folder}/open.key"', "others may read"),
                           (f'certificate = "{folder}/none.pem"\nkey = "{folder}/server.key"', "none.pem"),
                           (f'certificate = "{folder}/server.pem"\nkey = "{folder}/anna.key"', "anna.key"),
                           (f'certificate = "{folder}/server.pem"', "key"),
                           (f'certificate = "{folder}/server.pem"\nkey = "{folder}/server.key"\nclient_crl = "{folder}/crl.pem"', "client_ca")):
            with self.assertRaises(RuntimeError) as raised:
                self.server(text=SERVO_TEXT + "\n[tls]\n" + more + "\n")
            self.assertIn(said, str(raised.exception))


class Mutual(TlsTest):
    def test_sec_03_only_valid_certificates_get_in(self):
        """Catches: a client without a certificate, or with one that is foreign, too old, too new, not for clients, or
        revoked."""
        server = self.mutual_server()
        self.tls_client(server, self.context("anna"))
        for name in (None, "foreign", "old", "early", "machine", "gone"):
            with self.subTest(certificate=name):
                self.assertTurnedAway(server, self.context(name))
        self.assertIn("no TLS", server.errors())
        anna = self.tls_client(server, self.context("anna"))
        self.assertDone(anna.lease())
        said = self.assertAllRefusalsAreCounted(server, anna, 6)
        self.assertEqual(len(set(said)), 6, "each with its own reason")
        self.assertIn("certificate of gone", said[-1])

    def test_sec_03_refused_certificates_are_logged(self):
        """Catches: a log that does not name the certificate and the reason."""
        for name, why in (("gone", "certificate revoked"), ("old", "certificate has expired")):
            server = self.mutual_server()
            self.assertTurnedAway(server, self.context(name), why)
            self.assertIn(f"certificate of {name}", server.errors())

    def test_sec_03_no_ticket_replaces_the_certificate(self):
        """Catches: a ticket that opens a session after the certificate was revoked; or one that is issued and then
        refused."""
        server, anna = self.mutual_server(), self.context("anna")
        first = self.tls_client(server, anna)
        again = anna.wrap_socket(server.raw(), server_hostname="127.0.0.1", session=first.socket.session)
        self.assertEqual(Client(again, True).status().sessions, 2)
        self.assertFalse(again.session_reused)
        again.close()

    def test_sec_03_a_name_with_control_characters_moves_no_terminal(self):
        """Catches: an unsigned certificate whose name writes lines, or colours, into the log."""
        server = self.mutual_server()
        self.made.openssl("req", "-x509", *self.made.key("odd.key"), "-subj", "/CN=odd\x1b[2J\n[error] forged", "-out", "odd.pem")
        self.assertTurnedAway(server, self.context("odd"), "certificate of odd")
        self.assertNotIn("\x1b", server.errors())
        self.assertFalse(any(line.startswith("[error] forged") for line in server.errors().splitlines()))

    def test_a_long_name_is_cut_between_characters(self):
        """Catches: a certificate whose name is cut within a character: a client that asks for the owner of an axis could
        not decode the answer."""
        self.made.issue("long", subject="\N{EURO SIGN}" * 64)  # three bytes each; no name may have more letters
        server = self.mutual_server()
        self.assertDone(self.tls_client(server, self.context("long")).lease())
        told = self.tls_client(server, self.context("anna")).lease().refusal
        self.assertRegex(told.holder, "^\N{EURO SIGN}{50,64}")

    def test_the_command_speaks_tls(self):
        """Catches: a client that needs a foreign tunnel, that talks to any server, or that connects without a
        certificate."""
        folder, server = self.made.folder, self.mutual_server()
        place = "tls:127.0.0.1:%d" % server.address[1]
        ours = f"{place}?ca={folder}/ca.pem&certificate={folder}/anna.pem&key={folder}/anna.key"

        def drivebench(*arguments):
            return subprocess.run([DRIVEBENCH, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        moved = drivebench("control", "--json", "--link", ours)
        self.assertEqual(moved.returncode, 0, moved.stderr)
        self.assertLess(json.loads(moved.stdout)["peak_error_counts"], 2.0)
        for link, code in ((f"{place}?ca={folder}/stranger.pem", 3), (place, 3), (f"{place}?ca={folder}/none.pem", 3),
                           (f"{place}?ca={folder}/ca.pem", 1)):  # here only the answer to hello is missing
            refused = drivebench("status", "--link", link)
            self.assertEqual(refused.returncode, code, link)
            self.assertTrue(refused.stderr, link)

    def test_a_server_with_a_foreign_certificate_is_refused(self):
        """Catches: a client that talks to any server."""
        server = self.tls_server()
        with self.assertRaises(ssl.SSLCertVerificationError):
            self.tls_client(server, self.context(authority="stranger"))


if __name__ == "__main__":
    for program in ("openssl", "faketime"):
        if shutil.which(program) is None:
            print(f"SKIPPED: {program} is not installed")
            sys.exit(77)
    unittest.main(verbosity=2)
