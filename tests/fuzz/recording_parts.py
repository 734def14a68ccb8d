"""Recordings (MCAP) taken apart and put together without their long parts, for make_corpus.py."""
import struct

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, CHUNK_INDEX = 1, 2, 3, 4, 5, 6, 8
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, DATA_END = 9, 10, 11, 12, 13, 15


def records(data, at=0):
    while at < len(data):
        (size,) = struct.unpack_from("<Q", data, at + 1)
        yield data[at], data[at + 9:at + 9 + size]
        at += 9 + size


def text(value):
    value = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(value)) + value


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def without_text(schema):
    name_size, = struct.unpack_from("<I", schema, 2)
    encoding_size, = struct.unpack_from("<I", schema, 6 + name_size)
    return schema[:10 + name_size + encoding_size] + text(b"")


def with_configuration(attachment, config):
    at = 16
    for _ in range(2):
        at += 4 + struct.unpack_from("<I", attachment, at)[0]
    return attachment[:at] + struct.pack("<Q", len(config)) + config + struct.pack("<I", 0)


def configuration_of(attachment):
    at = 16
    for _ in range(2):
        at += 4 + struct.unpack_from("<I", attachment, at)[0]
    (size,) = struct.unpack_from("<Q", attachment, at)
    return attachment[at + 8:at + 8 + size]


def taken_apart(recording):
    parts = {SCHEMA: [], CHANNEL: [], MESSAGE: [], ATTACHMENT: []}
    for opcode, content in records(recording[8:-8]):
        if opcode == DATA_END:
            return parts
        if opcode == CHUNK:
            for inner, body in records(content[40:]):
                parts[inner].append(without_text(body) if inner == SCHEMA else body)
        elif opcode in parts:
            parts[opcode].append(content)
    raise RuntimeError("the recording does not end")


def put_together(parts, attachment, chunked, metadata=()):
    """A whole MCAP file with summary; a checksum of 0 says that there is none."""
    out = MAGIC + record(HEADER, text("") + text("fuzz"))
    indexes = b""

    def indexed(opcode, content, index_opcode, index):
        nonlocal out, indexes
        written = record(opcode, content)
        indexes += record(index_opcode, index(len(out), len(written)))
        out += written

    if attachment:
        indexed(ATTACHMENT, attachment, ATTACHMENT_INDEX,
                lambda at, size: struct.pack("<QQQQQ", at, size, 0, 0, 0) + text("bench.toml") + text(""))
    for content in metadata:
        indexed(METADATA, content, METADATA_INDEX, lambda at, size: struct.pack("<QQ", at, size) + text("m"))
    body = b"".join(record(kind, each) for kind in (SCHEMA, CHANNEL, MESSAGE) for each in parts[kind])
    if chunked:
        content = struct.pack("<QQQI", 0, 750000, len(body), 0) + text("") + struct.pack("<Q", len(body)) + body
        indexed(CHUNK, content, CHUNK_INDEX, lambda at, size: struct.pack("<QQQQIQ", 0, 750000, at, size, 0, 0)
                + text("") + struct.pack("<QQ", len(body), len(body)))
    else:
        out += body
    out += record(DATA_END, struct.pack("<I", 0))
    summary = len(out)
    out += b"".join(record(kind, each) for kind in (SCHEMA, CHANNEL) for each in parts[kind])
    out += record(STATISTICS, struct.pack(
        "<QHIIIIQQI", len(parts[MESSAGE]), len(parts[SCHEMA]), len(parts[CHANNEL]), 1 if attachment else 0,
        len(metadata), 1 if chunked else 0, 0, 750000, 0))
    return out + indexes + record(FOOTER, struct.pack("<QQI", summary, 0, 0)) + MAGIC


def channel_of(parts, message):
    return next(channel for channel in parts[CHANNEL] if channel[:2] == message[:2])
