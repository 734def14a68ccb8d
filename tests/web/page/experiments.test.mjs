// node --test experiments.test.mjs
//
// Experiments and their player without a browser. A test's comment names the mistake that it catches.
import assert from "node:assert/strict";
import test from "node:test";
import { page } from "./sources.mjs";

const { pb, Track, recordedRows, recordedFile, csvOfRows, Pieces, inputsOf, channelsOf, fieldsOfShape, shapeOf, eventOf,
  identification, fetchExperiment, RequestKeys, fileNameOf, factsOf, arrivalOf } = page;

const kBench = { name: "b", period_s: 1, axes: [{ name: "x", phases: 3 }, { name: "y", phases: 3 }],
  signals: [{ name: "tick", unit: "ticks" }, { name: "i_a_a", unit: "A" }, { name: "speed_rad_s", unit: "rad/s" }] };

// Catches: columns exchanged, big-endian numbers, ticks that forget the decimation, rows beyond the position of the player.
test("rows of an experiment become a track up to its position", async () => {
  const view = new DataView(new ArrayBuffer(48));
  [1, 10, 2, 20, 3, 30].forEach((value, i) => view.setFloat64(8 * i, value, true));
  const info = { axis: 1, signals: ["i_a_a", "speed_rad_s"], decimation: 5, period_s: 0.25 };
  const recorded = recordedRows(kBench, info, new Uint8Array(view.buffer));
  assert.deepEqual([recorded.description.axes.map((each) => each.name), recorded.sampleS], [["y"], 1.25]);
  assert.deepEqual(recorded.description.signals.map((each) => each.name), info.signals);
  const [track] = recorded.histories;
  track.choose(["speed_rad_s", "torque_nm"]);
  const all = track.rows(0, 100);
  assert.deepEqual([[...all.ticks], [...all.columns.get("speed_rad_s")], [...all.columns.get("torque_nm")]], [[0, 5, 10], [10, 20, 30], [NaN, NaN, NaN]]);
  track.lastTick = 7;
  assert.deepEqual([[...track.rows(0, 100).ticks], track.sample().i_a_a], [[0, 5], 2]);
  assert.equal((await csvOfRows(track, kBench.signals, info.signals, 0.25)).join(""),
    "tick,time_s,i_a_a [A],speed_rad_s [rad/s]\n0,0.000000000,1,10\n5,1.250000000,2,20\n10,2.500000000,3,30\n");
});

// Catches: a large table that is one text, or during which the page does nothing else, so that the gateway gives up an axis that it drives.
test("a large table comes in parts, between which the page does other work", async () => {
  const rows = 200_000;
  const track = new Track(Float64Array.from({ length: rows }, (_, row) => row), (row) => ({ tick: row, i_a_a: 0.5 * row }));
  let turns = 0;
  const others = setInterval(() => ++turns, 1);
  const parts = await csvOfRows(track, kBench.signals, ["i_a_a"], 0.001);
  clearInterval(others);
  const lines = parts.join("").split("\n");
  assert.ok(turns > 1 && parts.length > 3, `${turns} turns, ${parts.length} parts`);
  assert.deepEqual([lines.length, lines[0], lines[rows]], [rows + 2, "tick,time_s,i_a_a [A]", "199999,199.999000000,99999.5"]);
});

/** A record of an MCAP file. */
const record = (kind, ...parts) => {
  const content = Buffer.concat(parts);
  const size = Buffer.alloc(8);
  size.writeBigUInt64LE(BigInt(content.length));
  return Buffer.concat([Buffer.from([kind]), size, content]);
};
const u16 = (value) => { const bytes = Buffer.alloc(2); bytes.writeUInt16LE(value); return bytes; };
const u32 = (value) => { const bytes = Buffer.alloc(4); bytes.writeUInt32LE(value); return bytes; };
const u64 = (value) => { const bytes = Buffer.alloc(8); bytes.writeBigUInt64LE(BigInt(value)); return bytes; };
const words = (text) => Buffer.concat([u32(text.length), Buffer.from(text)]);
const kMagic = Buffer.from("\x89MCAP0\r\n", "latin1");
const channel = (id, topic) => record(4, u16(id), u16(1), words(topic), words("protobuf"), u32(0));
const message = (id, tick, speed) => record(5, u16(id), u32(0), u64(1000 + 125_000 * tick), u64(0), pb.Sample.encode({ tick, speed_rad_s: speed }).finish());
const chunk = (compression, ...records) => {
  const content = Buffer.concat(records);
  return record(6, u64(0), u64(0), u64(content.length), u32(0), words(compression), u64(content.length), content);
};

// Catches: messages of inputs that are read as samples, axes exchanged, a period from a clock that does not begin at 0, a torn
// end or a hostile length that throws or reads beyond the file.
test("a recording gives the samples of its axes, as far as it is whole", () => {
  const content = [kMagic, record(1, words(""), words("")), chunk("", channel(0, "/inputs"), channel(1, "/x/sample"), channel(2, "/z/sample"),
    message(1, 8, 1), message(2, 8, -1), message(0, 8, 99), message(1, 9, 2)), chunk("", message(1, 10, 3))];
  const whole = Buffer.concat(content);
  const recorded = recordedFile(kBench, whole);
  assert.deepEqual(recorded.description.axes.map((each) => each.name), ["x", "z"]);
  assert.deepEqual([recorded.description.period_s, recorded.firstTick], [0.000125, 8]);
  const [x, z] = recorded.histories;
  for (const each of [x, z]) each.choose(["speed_rad_s"]);
  assert.deepEqual([[...x.column("speed_rad_s")], [...z.column("speed_rad_s")]], [[1, 2, 3], [-1]]);
  assert.equal(recordedFile(kBench, whole.subarray(0, whole.length - 3)).histories[0].ticks.length, 2);
  for (let end = 0; end < whole.length; ++end) {
    try {
      recordedFile(kBench, whole.subarray(0, end));
    } catch (problem) {
      assert.match(problem.message, /no recording|no samples/);
    }
  }
  const hostile = Buffer.concat([kMagic, Buffer.from([6]), Buffer.alloc(8, 0xff), Buffer.alloc(64)]);
  assert.throws(() => recordedFile(kBench, hostile), /no samples/);
  assert.throws(() => recordedFile(kBench, Buffer.concat([kMagic, chunk("zstd", message(1, 8, 1))])), /compressed/);
});

// Catches: a period of 0 or less, with which the player never ends, tracks without end, an axis that stands twice, a call for each
// nested chunk until there is no stack, a sentence of the decoder.
test("a damaged recording is refused in words, or played with the period of the bench", () => {
  const at = (timeNs, tick) => record(5, u16(1), u32(0), u64(timeNs), u64(0), pb.Sample.encode({ tick }).finish());
  const file = (...records) => Buffer.concat([kMagic, chunk("", channel(1, "/x/sample"), ...records)]);
  for (const times of [[5, 5], [9, 5]]) {
    const recorded = recordedFile(kBench, file(at(times[0], 1), at(times[1], 2)));
    assert.equal(recorded.description.period_s, kBench.period_s);
  }
  assert.equal(recordedFile(kBench, file(channel(1, "/x/sample"), message(1, 8, 1))).histories.length, 1);
  assert.throws(() => recordedFile(kBench, file(channel(2, "/x/sample"))), /two channels of axis 'x'/);
  const many = Array.from({ length: 64 }, (_, i) => channel(2 + i, `/axis${i}/sample`));
  assert.equal(recordedFile(kBench, file(...many.slice(1), message(1, 8, 1))).histories.length, 1);
  assert.throws(() => recordedFile(kBench, file(...many)), /more than 64 axes/);
  assert.throws(() => recordedFile(kBench, file(chunk("", message(1, 8, 1)))), /a chunk lies in a chunk/);
  assert.throws(() => recordedFile(kBench, file(record(5, u16(1), u32(0), u64(0), u64(0), Buffer.from([0x09, 1])))), /sample 1 of axis 'x' cannot be read/);
});

/** Fetches from a gateway that `serve` plays; the timers do not wait. */
async function fetched(serve) {
  const before = globalThis.setTimeout;
  class Socket {
    static OPEN = 1;
    readyState = 1;
    constructor() { queueMicrotask(() => serve(this)); }
    close() {}
  }
  Object.assign(globalThis, { WebSocket: Socket, location: { protocol: "http:", host: "h" }, sessionStorage: { getItem: () => null },
    setTimeout: (act) => queueMicrotask(act) });
  const told = [];
  try {
    await fetchExperiment(1, "owner", false, { progress: () => undefined, waits: (sentence) => told.push(sentence) }, new AbortController().signal);
    return { told };
  } catch (problem) {
    return { told, problem: problem.message };
  } finally {
    globalThis.setTimeout = before;
  }
}
const answered = (socket, envelope) => {
  const payload = Buffer.from(pb.Envelope.encode(envelope).finish());
  const size = Buffer.alloc(4);
  size.writeUInt32BE(payload.length);
  socket.onmessage({ data: Uint8Array.from(Buffer.concat([size, payload])).buffer });
};

// Catches: a fetch that tries for ever without a word, the bench's sentence that is lost, an exception after which it waits for ever.
test("a fetch that is not let in says why, and gives up", async () => {
  const full = await fetched((socket) => socket.onclose({ code: 1006, reason: "" }));
  assert.deepEqual(full.told, Array(9).fill("the gateway does not answer (1006)"));
  assert.equal(full.problem, "the gateway does not answer (1006); given up after 10 tries");
  const busy = await fetched((socket) => {
    socket.close = () => socket.onclose({ code: 1005, reason: "" });
    socket.send = (frame) => answered(socket, { id: pb.Envelope.decode(new Uint8Array(frame).subarray(4)).id,
      refusal: { code: pb.RefusalCode.REFUSAL_BUSY, message: "too many sessions" } });
    socket.onopen();
  });
  assert.equal(busy.problem, "too many sessions; given up after 10 tries");
  const torn = await fetched((socket) => {
    socket.send = (frame) => {
      const { id, hello } = pb.Envelope.decode(new Uint8Array(frame).subarray(4));
      if (hello) return answered(socket, { id, welcome: {} });
      answered(socket, { id, experiment_info: { id: 1, signals: ["i_a_a"], decimation: 1, rows: 9, state: 3 } });
      answered(socket, { id, experiment_data: { first: 5, data: new Uint8Array(8) } });
    };
    socket.onopen();
  });
  assert.equal(torn.problem, "the bench left out a piece of the data");
});

// Catches: a second experiment for a press whose answer a broken connection lost, one key for two experiments.
test("a request keeps its key until it is answered", () => {
  const keys = new RequestKeys();
  const first = keys.keyOf({ label: "a" });
  assert.equal(keys.keyOf({ label: "a" }), first);
  assert.notEqual(keys.keyOf({ label: "b" }), first);
  const other = keys.keyOf({ label: "b" });
  keys.answered();
  assert.notEqual(keys.keyOf({ label: "b" }), other);
});

// Catches: the first part of the data that passes for all of them, in the page, in a file's name or before an identification.
test("shortened data say so", () => {
  const info = { id: 7, axis: 0, state: 3, period_s: 0.001, tick: 9, ticks: 9, rows: 10, signals: ["i_a_a"], decimation: 1 };
  const axes = [{ name: "x", machine_kind: "induction" }];
  const [whole, part] = [true, false].map((isWhole) => ({ info, isWhole }));
  assert.deepEqual([fileNameOf(whole, "csv"), fileNameOf(part, "mcap")], ["experiment-7.csv", "experiment-7-first-128MiB.mcap"]);
  const [all, some] = [whole, part].map((each) => Object.fromEntries(factsOf(axes, each, "save it")));
  assert.deepEqual([all.identify, all.shortened, some.identify], ["save it, then drivebench identify --motor im --from experiment-7.mcap", undefined, undefined]);
  for (const text of [some.shortened, arrivalOf(part)]) assert.match(text, /the first 128 MiB; drivebench experiment fetch 7 has all/);
  assert.equal(arrivalOf(whole), "experiment 7: completed");
});

// Catches: pieces that come twice after a broken connection and stand twice, a hole that is filled with zeros.
test("pieces that come twice count once", () => {
  const pieces = new Pieces();
  pieces.take(0, Uint8Array.from([1, 2, 3]));
  pieces.take(1, Uint8Array.from([2, 3, 4]));
  pieces.take(0, Uint8Array.from([1, 2]));
  assert.deepEqual([...pieces.all], [1, 2, 3, 4]);
  assert.throws(() => pieces.take(5, Uint8Array.from([6])), /left out/);
  const big = new Uint8Array(300_000).fill(7);
  pieces.take(4, big);
  assert.equal(pieces.size, 300_004);
  assert.ok(pieces.all.subarray(4).every((each) => each === 7));
});

// Catches: a shape on the channel of another, an input that the drive cannot take, a field whose name the bench does not know.
test("an experiment asks for what its form says", () => {
  const star = { drive_kind: "voltage_amplifier", connection: "star", phases: 3 };
  const { INPUT_KIND_SOURCE, INPUT_KIND_DQ_VOLTAGES, INPUT_KIND_PHASE_VOLTAGES, INPUT_KIND_NONE, INPUT_KIND_PHASE_CURRENTS } = pb.InputKind;
  assert.deepEqual(inputsOf({ ...star, drive_kind: "source" }), [INPUT_KIND_SOURCE]);
  assert.deepEqual(inputsOf({ ...star, shares_amplifier_with: "other" }), [INPUT_KIND_NONE]);
  assert.deepEqual(inputsOf({ drive_kind: "voltage_amplifier", connection: "armature", phases: 1 }), [INPUT_KIND_PHASE_VOLTAGES, INPUT_KIND_NONE]);
  assert.deepEqual(channelsOf(INPUT_KIND_DQ_VOLTAGES, { ...star, field_winding: true }).map(([, name]) => name), ["q", "d", "f"]);
  assert.deepEqual(channelsOf(INPUT_KIND_PHASE_VOLTAGES, { ...star, phases: 2 }).map(([, name]) => name), ["a", "b"]);
  assert.equal(fieldsOfShape("sine", INPUT_KIND_PHASE_CURRENTS)[0].label, "amplitude, A");
  for (const kind of ["constant", "ramp", "sine", "three_phase", "chirp", "prbs", "multisine"]) {
    const values = Object.fromEntries(fieldsOfShape(kind, INPUT_KIND_PHASE_VOLTAGES).map(({ name }, i) => [name, i + 2]));
    const sent = pb.Envelope.decode(pb.Envelope.encode({ run_experiment: { input: { shapes: [shapeOf(kind, pb.Channel.CHANNEL_B, 1, 2, values)] } } }).finish());
    const [{ channel: on, start_s: start, end_s: end, [kind]: shape }] = sent.run_experiment.input.shapes;
    assert.deepEqual([on, start, end], [kind === "three_phase" ? 0 : pb.Channel.CHANNEL_B, 1, 2]);
    if (kind === "multisine") assert.deepEqual([shape.amplitude, shape.base_hz, shape.harmonics], [2, 3, [1, 2, 3, 4]]);
    else for (const [name, value] of Object.entries(values)) assert.equal(shape[name], value);
  }
  assert.deepEqual(eventOf("load", 1, 2, 3), { at_s: 1, ramp_s: 3, load_nm: 2 });
  assert.deepEqual(eventOf("fault:open_phase", 1, 2, 0), { at_s: 1, ramp_s: 0, fault: { name: "open_phase", value: 2 } });
  const machines = [{ name: "x", machine_kind: "shunt_dc" }, { name: "y", machine_kind: "pm_synchronous" }];
  assert.equal(identification(machines.slice(1), 0, "e.mcap"), "drivebench identify --motor pm --from e.mcap");
  assert.equal(identification(machines, 1, "e.mcap"), "drivebench identify --motor pm --from e.mcap --axis y");
  assert.equal(identification(machines, 0, "e.mcap"), "");
});
