"""A link between two networks that loses, damages, delays and overtakes: two TUN devices and a thread between them."""
import concurrent.futures
import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import threading
import time
import unittest

CLONE_NEWNET = 0x40000000
TUNSETIFF = 0x400454CA
IFF_TUN, IFF_NO_PI = 1, 0x1000
HERE, THERE = "10.77.0.1", "10.77.0.2"


def tun(name, address, peer):
    """A new device in the calling thread's network."""
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TUN | IFF_NO_PI))
    for words in (f"address add {address} peer {peer} dev {name}", f"link set {name} up mtu 1400"):
        subprocess.run(["ip", *words.split()], check=True)
    return device


class BadLink:
    """Between the network of the test, with HERE, and another one, with THERE. Good until `get_bad`."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.loss, self.damage, self.jitter_s = 0.0, 0.0, 0.0
        self.cut = False
        self.longest_pause_s = 0.0  # of the thread that carries the packets: a busy machine may keep it waiting
        self.counts = {"passed": 0, "lost": 0, "damaged": 0, "overtaken": 0}
        self.far = concurrent.futures.ThreadPoolExecutor(1)
        self.stopped = threading.Event()
        try:
            self.ends = [tun("here", HERE, THERE), self.far.submit(self.open_far_end).result()]
        except OSError as error:
            raise unittest.SkipTest(f"no TUN device in a network of its own: {error}") from error
        self.thread = threading.Thread(target=self.carry, daemon=True)
        self.thread.start()

    @staticmethod
    def open_far_end():
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.unshare(CLONE_NEWNET) != 0:
            raise OSError(ctypes.get_errno(), "unshare")
        return tun("there", THERE, HERE)

    def there(self, function, *arguments, **options):
        """Calls it in the other network; a socket that it makes stays there."""
        return self.far.submit(function, *arguments, **options).result()

    def get_bad(self, loss, damage, jitter_s):
        """Loses or damages at most one of three packets, so that no retransmission fails for long; every packet takes up
        to `jitter_s` and may overtake others."""
        self.loss, self.damage, self.jitter_s = loss, damage, jitter_s

    def close(self):
        if self.stopped.is_set():
            return
        self.stopped.set()
        self.thread.join()
        self.far.shutdown()
        for device in self.ends:
            os.close(device)

    def carry(self):
        under_way, number, since_loss, newest = [], 0, 2, [0, 0]
        seen = time.monotonic()
        while not self.stopped.is_set():
            now = time.monotonic()
            self.longest_pause_s = max(self.longest_pause_s, now - seen)
            seen = now
            wait_s = max(0.0, under_way[0][0] - time.monotonic()) if under_way else 0.05
            for device in select.select(self.ends, [], [], min(wait_s, 0.05))[0]:
                packet = bytearray(os.read(device, 65536))
                since_loss += 1
                luck = self.random.random() if since_loss > 2 else 1.0
                if self.cut or luck < self.loss + self.damage:
                    since_loss = 0
                if self.cut or luck < self.loss:
                    self.counts["lost"] += 1
                    continue
                if luck < self.loss + self.damage:
                    packet[self.random.randrange(len(packet))] ^= 1 << self.random.randrange(8)
                    self.counts["damaged"] += 1
                number += 1
                towards = 1 - self.ends.index(device)
                heapq.heappush(under_way, (time.monotonic() + self.random.uniform(0.0, self.jitter_s), number, towards, packet))
            while under_way and under_way[0][0] <= time.monotonic():
                _, number_of_it, towards, packet = heapq.heappop(under_way)
                self.counts["passed"] += 1
                self.counts["overtaken"] += number_of_it < newest[towards]
                newest[towards] = max(newest[towards], number_of_it)
                try:
                    os.write(self.ends[towards], packet)
                except OSError:
                    pass  # damaged beyond recognition
