"""Ports that the system chooses, for programs that must be told the number: all on a multicast bus, the daemons of Slurm."""
import contextlib
import random
import socket


def free_udp_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return probe.getsockname()[1]


def free_ports(count):
    """Below those that the system gives to outgoing connections, which come and go meanwhile."""
    with contextlib.ExitStack() as held:
        ports = []
        while len(ports) < count:
            probe = held.enter_context(socket.socket())
            try:
                probe.bind(("127.0.0.1", random.randrange(20_000, 32_000)))
            except OSError:
                continue
            ports.append(probe.getsockname()[1])
        return ports
