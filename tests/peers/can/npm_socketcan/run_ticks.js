// node run_ticks.js INTERFACE classic|fd TICKS U_A U_B
//
// Takes the axis of node 1, answers that many lockstep ticks with the same voltages [V], gives the axis back. Prints
// one JSON list: [tick, count, i_a, i_b] of every sample. The frames are as `drivebench-server CONFIG --print
// can-table` describes them.
"use strict";
const can = require("socketcan");

const kController = 77;
const kPatienceMs = 30_000;
const kSync = 0x008;
const kCurrents = 0x061;
const kSensors = 0x061;
const kCommand = 0x031;
const kEncoder = 0x041;
const kRequest = 0x071;
const kReply = 0x681;
const kAcquire = 1;
const kRelease = 3;
const kVoltages = 1;

const [name, kind, tickText, ...voltages] = process.argv.slice(2);
const fd = kind === "fd";
const ticks = Number(tickText);
const [u_a, u_b] = voltages.map(Number);

const channel = can.createRawChannel(name);
const samples = [];
let lease = 0;
let count = null;
let sample = null;

function fail(why) {
  console.error(`run_ticks: ${why}`);
  process.exit(1);
}

function send(id, data) {
  const message = { id, ext: false, rtr: false, data };
  if (fd) channel.sendFD({ ...message, fd_brs: true });
  else channel.send(message);
}

function request(what) {
  const data = Buffer.alloc(8);
  data.writeUInt8(what, 0);
  data.writeUInt8(lease, 1);
  data.writeUInt32LE(kController, 2);
  send(kRequest, data);
}

function command(tick) {
  const data = Buffer.alloc(fd ? 16 : 8);
  if (fd) {
    data.writeUInt32LE(tick, 0);
    data.writeFloatLE(u_a, 4);
    data.writeFloatLE(u_b, 8);
    data.writeUInt8(kVoltages, 12);
    data.writeUInt8(lease, 13);
  } else {
    data.writeInt16LE(Math.round(u_a * 100), 0);
    data.writeInt16LE(Math.round(u_b * 100), 2);
    data.writeUInt16LE(tick & 0xffff, 4);
    data.writeUInt8(kVoltages, 6);
    data.writeUInt8(lease, 7);
  }
  send(kCommand, data);
}

function onReply(data) {
  if (data.readUInt8(0) !== 0 && data.readUInt32LE(2) !== kController) return;
  if (data.readUInt8(1) !== 0) fail(`request ${data.readUInt8(0)} was refused: result ${data.readUInt8(1)}`);
  if (data.readUInt8(0) === kAcquire) lease = data.readUInt8(6);
  if (data.readUInt8(0) === kRelease) {
    channel.stop();
    clearTimeout(patience);
    console.log(JSON.stringify(samples));
  }
}

function onSync(data) {
  const tick = data.readUInt32LE(0);
  if (lease === 0 || sample === null || samples.length > ticks) return;
  if (sample[0] !== (fd ? tick : tick & 0xffff)) fail(`the sample of tick ${tick} is missing`);
  samples.push([tick, ...sample.slice(1)]);
  if (samples.length > ticks) request(kRelease);
  else command(tick);
}

channel.addListener("onMessage", ({ id, err, data }) => {
  if (err) return;
  if (id === kReply) onReply(data);
  if (id === kSync) onSync(data);
  if (id === kEncoder) count = data.readInt32LE(0);
  if (fd && id === kSensors)
    sample = [data.readUInt32LE(0), data.readInt32LE(12), data.readFloatLE(4), data.readFloatLE(8)];
  if (!fd && id === kCurrents)
    sample = [data.readUInt16LE(4), count, data.readInt16LE(0) / 1000, data.readInt16LE(2) / 1000];
});
const patience = setTimeout(() => fail(`nothing more came after ${samples.length} samples`), kPatienceMs);
channel.start();
request(kAcquire);
