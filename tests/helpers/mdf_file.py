"""A strict reader of MDF 4.1 files with one sorted channel group, written from the ASAM standard."""
import struct
from xml.etree import ElementTree

ID_BYTES = 64
HEAD = struct.Struct("<4sIQQ")
LINKS = {b"##HD": 6, b"##FH": 2, b"##DG": 4, b"##CG": 6, b"##CN": 8, b"##TX": 0, b"##MD": 0, b"##DT": 0}
DATA = {b"##HD": 32, b"##FH": 16, b"##DG": 8, b"##CG": 32, b"##CN": 72}  # bytes behind the links
TYPES = {0: "Q", 2: "q", 4: "d"}  # unsigned, signed, floating-point, all little-endian


def check(condition, rule):
    if not condition:
        raise AssertionError(rule)


class MdfFile:
    def __init__(self, path):
        self.raw = path.read_bytes()
        check(self.raw[:8] == b"MDF     " and self.raw[8:16] == b"4.10    ", "identification")
        check(struct.unpack_from("<H", self.raw, 28) == (410,), "version number")
        check(self.raw[60:64] == bytes(4), "the file says that it was not finalised")
        links, start = self.block(ID_BYTES, b"##HD")
        self.start_ns, zone_min, saving_min, flags, clock, angles = struct.unpack_from("<QhhBBB", start)
        check(zone_min == saving_min == clock == angles == 0, "the start is in UTC")
        check(flags == (2 if self.start_ns else 0), "a start in UTC has its offsets, none has no flags")
        self.check_history(links[1])
        self.read_group(links[0])

    def block(self, at, kind):
        """Links and data of a block."""
        check(at % 8 == 0 and at >= ID_BYTES, f"a block at {at}")
        found, reserved, length, count = HEAD.unpack_from(self.raw, at)
        check(found == kind and reserved == 0, f"{found} where {kind} should be")
        check(count == LINKS[kind], f"{kind} with {count} links")
        check(at + length <= len(self.raw), f"{kind} is longer than the file")
        if kind in DATA:
            check(length == HEAD.size + 8 * count + DATA[kind], f"{kind} of {length} bytes")
        links = struct.unpack_from(f"<{count}Q", self.raw, at + HEAD.size)
        return links, self.raw[at + HEAD.size + 8 * count : at + length]

    def text(self, at, kind=b"##TX"):
        data = self.block(at, kind)[1]
        check(data.endswith(b"\0") and len(data) % 8 == 0, "a text ends with a zero and fills whole words")
        return data.rstrip(b"\0").decode()

    def check_history(self, at):
        links, _ = self.block(at, b"##FH")
        root = ElementTree.fromstring(self.text(links[1], b"##MD"))
        names = [child.tag.rpartition("}")[2] for child in root]
        check(names == ["TX", "tool_id", "tool_vendor", "tool_version"], f"history: {names}")

    def read_group(self, at):
        links, data = self.block(at, b"##DG")
        check(links[0] == 0 and data[0] == 0, "one data group, without record ids")
        records = self.block(links[2], b"##DT")[1]
        group, numbers = self.block(links[1], b"##CG")
        self.name = self.text(group[2])
        _, self.cycles, flags, separator, _, data_bytes, invalid_bytes = struct.unpack("<QQHHIII", numbers)
        check(flags == 0 and separator == 0 and invalid_bytes == 0, "channel group")
        check(len(records) == self.cycles * data_bytes, f"{len(records)} bytes of {self.cycles} records")
        self.units, self.columns, masters = {}, {}, []
        layout = "<"
        names = []
        at = group[1]
        while at:
            channel, numbers = self.block(at, b"##CN")
            kind, sync, data_type, bit_offset, byte_offset, bits, flags = struct.unpack_from("<BBBBIII", numbers)
            check(bits == 64 and bit_offset == 0 and flags == 0 and byte_offset == 8 * len(names), "channel")
            check((kind, sync) in ((2, 1), (0, 0)), "a channel is the time's or of fixed length")
            names.append(self.text(channel[2]))
            if kind == 2:
                masters.append(names[-1])
            self.units[names[-1]] = self.text(channel[6])
            check(self.text(channel[7]), "a channel without a meaning")
            layout += TYPES[data_type]
            at = channel[0]
        check(len(masters) == 1, "one master channel")
        self.master = masters[0]
        check(struct.calcsize(layout) == data_bytes, "the channels fill the record")
        rows = list(struct.iter_unpack(layout, records))
        for place, name in enumerate(names):
            self.columns[name] = [row[place] for row in rows]
