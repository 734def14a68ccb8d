"""A UDP port that the system chooses, for a multicast bus: all programs on the bus need its number."""
import socket


def free_udp_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return probe.getsockname()[1]
