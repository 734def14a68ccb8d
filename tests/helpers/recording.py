"""Reads recordings: a second parser, so that the product's does not check itself."""
import struct
import zlib


class Recording:
    """The contents of an MCAP file up to its last whole chunk."""

    MAGIC = b"\x89MCAP0\r\n"

    def __init__(self, data):
        self.has_start = data.startswith(self.MAGIC)
        self.contents = {}  # topic -> contents of its messages
        self.damaged = 0
        self.finished = data.endswith(self.MAGIC) and len(data) > 16
        self.topics = {}
        self.metadata = []  # (name, entries), in order
        at = 8
        while at + 9 <= len(data):
            opcode, (size,) = data[at], struct.unpack_from("<Q", data, at + 1)
            if at + 9 + size > len(data):
                break
            if opcode == 0x06:
                self.chunk(data[at + 9:at + 9 + size])
            elif opcode == 0x0C:
                self.metadata.append(self.metadata_in(data[at + 9:at + 9 + size]))
            at += 9 + size
        self.tail = len(data) - at  # bytes of a record that is not whole

    @property
    def messages(self):
        """Topic -> number."""
        return {topic: len(found) for topic, found in self.contents.items()}

    @staticmethod
    def metadata_in(content):
        texts, at = [], 0
        while at < len(content):
            (length,) = struct.unpack_from("<I", content, at)
            at += 4
            if len(texts) == 1:  # the length of all entries
                texts.append(None)
                continue
            texts.append(content[at:at + length].decode())
            at += length
        return texts[0], dict(zip(texts[2::2], texts[3::2]))

    def chunk(self, content):
        crc, length = struct.unpack_from("<I", content, 24)[0], struct.unpack_from("<I", content, 28)[0]
        at = 32 + length
        (size,) = struct.unpack_from("<Q", content, at)
        records = content[at + 8:at + 8 + size]
        if zlib.crc32(records) != crc:
            self.damaged += 1
            return
        at = 0
        while at < size:
            opcode, (length,) = records[at], struct.unpack_from("<Q", records, at + 1)
            if opcode == 0x04:
                channel, _, name = struct.unpack_from("<HHI", records, at + 9)
                self.topics[channel] = records[at + 17:at + 17 + name].decode()
            elif opcode == 0x05:
                topic = self.topics[struct.unpack_from("<H", records, at + 9)[0]]
                self.contents.setdefault(topic, []).append(records[at + 9 + 22:at + 9 + length])  # behind its header
            at += 9 + length
