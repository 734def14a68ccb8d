// Foxglove's own client reads a bench: node client.mjs URL SUBPROTOCOL SAMPLES. Prints `subscribed`, `reads` with
// the first sample, then what it was told as one line of JSON.
import { createRequire } from "node:module";
import { WebSocket } from "ws";

const require = createRequire(import.meta.url);
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const protobuf = require("protobufjs");
const { FileDescriptorSet } = require("protobufjs/ext/descriptor");

const [url, subprotocol, wanted] = process.argv.slice(2);
const told = { samples: [], times: [], statuses: [] };
const socket = new WebSocket(url, [subprotocol]);
const client = new FoxgloveClient({ ws: socket });
let Sample;
let subscription;

let isOver = false;

function end(problem) {
  if (isOver) return;
  isOver = true;
  if (problem) told.problem = String(problem);
  console.log(JSON.stringify({ ...told, subprotocol: socket.protocol }));
  process.exitCode = problem ? 1 : 0;
  socket.terminate();
}

client.on("error", end);
client.on("close", (event) => end(`closed: ${event.code} ${event.reason}`));
client.on("status", (status) => told.statuses.push(status));
client.on("serverInfo", (info) => (told.info = info));
client.on("time", ({ timestamp }) => told.times.push(Number(timestamp)));
client.on("advertise", (channels) => {
  told.topics = channels.map((channel) => channel.topic);
  const [channel] = channels;
  const set = FileDescriptorSet.decode(Buffer.from(channel.schema, "base64"));
  Sample = protobuf.Root.fromDescriptor(set).lookupType(channel.schemaName);
  subscription = client.subscribe(channel.id);
  console.log("subscribed");
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  if (subscriptionId !== subscription) end(`a message of the subscription ${subscriptionId}`);
  if (isOver) return;
  const sample = Sample.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  const { tick, speed_rad_s } = Sample.toObject(sample, { longs: Number, defaults: true });
  if (told.samples.length === 0) console.log("reads");
  told.samples.push({ time: Number(timestamp), tick, speed: speed_rad_s });
  if (told.samples.length >= Number(wanted) && told.times.length > 0) end();
});
