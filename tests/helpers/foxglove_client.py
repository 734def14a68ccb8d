"""A client of Foxglove's WebSocket that can break every rule of the protocol."""
import json

from web_client import BINARY, CLOSE, PING, PONG, TEXT, Browser


class Foxglove(Browser):
    """A WebSocket of `gateway`; the messages that come stand in the order of the wire."""

    def __init__(self, gateway, subprotocol="foxglove.sdk.v1", receive_buffer=None, path="/", **headers):
        super().__init__(gateway, False, "", receive_buffer, {"Sec-WebSocket-Protocol": subprotocol, **headers}, path)

    def message(self):
        """The next text as an object, or the bytes of a binary message."""
        opcode, data = self.read_frame()
        while opcode == PING:
            self.send_frame(PONG, data)
            opcode, data = self.read_frame()
        if opcode == CLOSE:
            self.closed_by(data)
        return json.loads(data) if opcode == TEXT else data

    def next_text(self, op):
        while True:
            message = self.message()
            if isinstance(message, dict) and message["op"] == op:
                return message

    def say(self, message):
        self.send_frame(TEXT, message if isinstance(message, bytes) else json.dumps(message).encode())

    def say_binary(self, data):
        self.send_frame(BINARY, data)

    def subscribe(self, channel=1, number=0):
        self.say({"op": "subscribe", "subscriptions": [{"id": number, "channelId": channel}]})
