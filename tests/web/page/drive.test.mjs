// node --test drive.test.mjs
//
// What the page says and asks while it drives, without a browser, and the reports that it shows. A test's comment names the mistake that it catches.
import assert from "node:assert/strict";
import test from "node:test";
import { page } from "./sources.mjs";

const { wordsOf, verdictOf, summaryOf, countsOf, identificationIn, isInside, amplitude, drawnSpeed, gatesOf, wavesOf, fieldsOf, targetOf, Leases, Changes, Wire, pb } = page;

// Catches: a common voltage of the terminals that counts as amplitude, the sum of three phases for their vector.
test("the amplitude of terminals", () => {
  const three = (angle) => [0, 1, 2].map((phase) => 24 + 10 * Math.cos(angle - (phase * 2 * Math.PI) / 3));
  for (const angle of [0, 0.4, 2]) assert.ok(Math.abs(amplitude(three(angle)) - 10) < 1e-12);
  assert.equal(amplitude([3, -4]), 5);
  assert.equal(amplitude([-6]), -6);
});

// Catches: a lease that was given back and then, with the refusal of an older renewal, is reported as taken away; a true loss
// that is not told.
test("a renewal that crosses the giving back", async (t) => {
  t.mock.timers.enable({ apis: ["setInterval"] });
  globalThis.window = globalThis;
  let renewed;
  const ask = ({ lease }) => lease.action === pb.LeaseRequest.Action.ACTION_RENEW
    ? new Promise((_, reject) => { renewed = () => reject(new Error("not yours")); }) : Promise.resolve({ done: { owner: 7 } });
  const leases = new Leases({ description: { axes: [{ name: "a" }], lease_s: 3 }, wire: { ask } });
  const told = [];
  leases.watch((axis, sentence) => told.push(sentence));
  const refuse = async () => {
    renewed();
    await new Promise((done) => setImmediate(done));
  };
  for (const isOver of [true, false]) { // the report that the drive is over comes before the refusal, or after it
    await leases.acquire(0);
    t.mock.timers.tick(1000);
    leases.areGivenBack = true;
    if (isOver) leases.lost(0, "");
    await refuse();
    if (!isOver) leases.lost(0, "");
  }
  assert.deepEqual(told, ["", "", "", ""]);
  await leases.acquire(0);
  t.mock.timers.tick(1000);
  await refuse();
  assert.deepEqual([told.at(-1), leases.holds(0)], ["lease: not yours", false]);
  leases.end();
});

// Catches: a page that waits for ever after its token, because the end of the session before, which came late, ended the hello of the
// new one, too.
test("a session that was turned away ends after the next has begun", async () => {
  const sockets = [];
  class Socket {
    constructor() {
      sockets.push(this);
      this.readyState = Socket.CONNECTING;
    }
    open() {
      this.readyState = Socket.OPEN;
      return this.onopen();
    }
    send(frame) {
      this.hello = pb.Envelope.decode(frame.subarray(4));
    }
    answer(kind) {
      const payload = pb.Envelope.encode({ ...kind, id: this.hello.id }).finish();
      this.onmessage({ data: Uint8Array.of(0, 0, payload.length >> 8, payload.length, ...payload).buffer });
    }
    close() {
      this.readyState = Socket.CLOSING;
    }
  }
  Object.assign(Socket, { CONNECTING: 0, OPEN: 1, CLOSING: 2 });
  const kept = { token: "" };
  Object.assign(globalThis, { WebSocket: Socket, location: { protocol: "http:", host: "here" }, sessionStorage: { getItem: (name) => kept[name] } });
  const told = [];
  const wire = new Wire({ welcome: ({ subject }) => told.push(subject), tokenWanted: (sentence) => told.push(sentence), lost: (sentence) => told.push(sentence) });

  wire.connect();
  const before = sockets[0].open();
  sockets[0].answer({ refusal: { code: pb.RefusalCode.REFUSAL_UNAUTHENTICATED, message: "a token is wanted" } });
  await before;
  kept.token = "secret";
  wire.connect();
  const next = sockets[1].open();
  sockets[0].answer({ welcome: { subject: "nobody", role: pb.Role.ROLE_VIEWER } });
  sockets[0].onclose({ code: 1000 });
  sockets[1].answer({ welcome: { subject: "anna", role: pb.Role.ROLE_OPERATOR } });
  await next;
  assert.deepEqual(told, ["a token is wanted", "anna"]);
  assert.equal(sockets[0].readyState, Socket.CLOSING);
  assert.equal(sockets[1].hello.hello.token, "secret");
});

const turn = () => new Promise((done) => setImmediate(done));

/** Leases of two axes with one amplifier; what they ask, of which the bench refuses one, and a change that ends when it is told to. */
function leasesOfTwo(t, refused = -1) {
  t.mock.timers.enable({ apis: ["setInterval"] });
  globalThis.window = globalThis;
  const { ACTION_ACQUIRE, ACTION_RENEW } = pb.LeaseRequest.Action;
  const asked = [];
  const ask = async ({ lease }) => {
    asked.push(lease.action === ACTION_ACQUIRE ? "acquire" : lease.action === ACTION_RENEW ? "renew" : "release");
    if (asked.length - 1 === refused) {
      await turn();
      throw new Error("the bench is busy");
    }
    return { done: { owner: 7 } };
  };
  const leases = new Leases({ description: { axes: [{ name: "a" }, { name: "b", shares_amplifier_with: "a" }], lease_s: 3 }, wire: { ask } });
  const change = (axis) => {
    let end;
    const done = leases.under(axis, () => new Promise((resolve) => { end = resolve; }));
    return { done, end: () => end() };
  };
  return { asked, leases, change };
}

// Catches: a borrowed lease that runs out before what it was borrowed for has ended; one that the first of two changes, of axes with
// one amplifier, gives back under the second.
test("a lease is borrowed until the last change has ended", async (t) => {
  const { asked, leases, change } = leasesOfTwo(t);
  const [first, second] = [change(0), change(1)];
  await turn();
  t.mock.timers.tick(1000);
  first.end();
  await first.done;
  t.mock.timers.tick(1000);
  await assert.rejects(leases.confirm(0).then(() => leases.acquire(0)).then(() => leases.release(0)), /a change of the axis is under way/);
  leases.lost(0, "taken");
  second.end();
  await second.done;
  t.mock.timers.tick(1000);
  assert.deepEqual(asked, ["acquire", "acquire", "renew", "renew", "renew", "acquire", "release"]);
  leases.end();
});

// Catches: a lease that stays because the change that ends last was refused it, after the one that had it.
test("a borrowed lease goes back although the last change is refused", async (t) => {
  const { asked, leases, change } = leasesOfTwo(t, 1);
  const first = change(0);
  await turn();
  const refused = change(0);
  first.end();
  await Promise.all([first.done, assert.rejects(refused.done, /busy/)]);
  assert.deepEqual(asked, ["acquire", "acquire", "release"]);
  leases.end();
});

// Catches: a lease that the page takes to keep while a change has borrowed it, and that goes back with the change.
test("a lease that is taken beside a change stays", async (t) => {
  const { asked, leases, change } = leasesOfTwo(t);
  const borrowed = change(0);
  await turn();
  const taken = leases.acquire(0);
  borrowed.end();
  await Promise.all([borrowed.done, taken]);
  assert.deepEqual([asked, leases.holds(1)], [["acquire", "acquire"], true]);
  await leases.release(1);
  assert.deepEqual([asked.at(-1), leases.holds(0)], ["release", false]);
  leases.end();
});

/** A bench on a slow way: it has gone on by so many ticks when a request arrives, and stands at the last tick that is given. */
function slowBench(ticksOnTheWay, standsAt = Infinity) {
  const bench = { tick: 100, asked: [] };
  bench.ask = async (kind) => {
    if (kind.status_request) {
      bench.tick = Math.min(bench.tick + 10, standsAt);
      return { status: { tick: bench.tick } };
    }
    bench.asked.push(kind.inject_fault ?? kind.set_load);
    if (bench.asked.length % 2 === 1) bench.tick += ticksOnTheWay;
    return { done: { tick: bench.tick } };
  };
  return bench;
}

const lent = { holds: () => false, under: (axis, act) => act(), confirm: async () => undefined };
const forTicks = (ticks) => (start) => [start, start + ticks].map((at_tick, i) => ({ inject_fault: { value: 1 - i, at_tick } }));

// Catches: a fault whose begin and end the bench has passed before it hears of them, so that it lasts no tick and is told as done;
// one that came late and lasted shorter, told with the ticks that were asked.
test("a fault of some ticks on a slow way", async () => {
  const inTime = slowBench(50);
  assert.deepEqual(await new Changes(inTime, lent, 1e-3).make(0, forTicks(3), false), [611, 614]);
  const slow = slowBench(1000);
  assert.deepEqual(await new Changes(slow, lent, 1e-3).make(0, forTicks(3), false), [3121, 3124]);
  assert.equal(slow.asked.length, 4);
  const late = slowBench(1000);
  assert.deepEqual(await new Changes(late, lent, 1e-3).make(0, forTicks(800), false), [1110, 1411]);
  await assert.rejects(new Changes(slowBench(1e6), lent, 1e-3).make(0, forTicks(3), false), /past the end of the fault/);
});

// Catches: a lease that is given back before the fault has ended, and a page that waits for ever for a bench that stands, or tells its fault as done.
test("the lease of a moment lasts until the fault has ended", async () => {
  const bench = slowBench(1);
  assert.deepEqual(await new Changes(bench, lent, 1e-3).make(0, forTicks(3), true), [611, 614]);
  assert.ok(bench.tick > 614);
  await assert.rejects(new Changes(slowBench(0, 300), lent, 1e-3).make(0, forTicks(3), true), /stands at tick 300: what was to act at tick 614/);
  const standing = slowBench(0, 110);
  assert.deepEqual(await new Changes(standing, lent, 1e-3).make(0, () => [{ set_load: {} }], true), [110]);
  const ranOut = { ...lent, confirm: () => Promise.reject(new Error("the lease is not yours")) };
  await assert.rejects(new Changes(slowBench(1), ranOut, 1e-3).make(0, forTicks(3), true), /with it ended what was scheduled: the lease is not yours/);
});

// Catches: a run that ended early and is called done, a part of a run that is rounded up to the whole.
test("the words for the run of a preset", () => {
  const run = { number: 1, preset: "p", phase: "moving", progress: 0.999, failure: "", numbers: [] };
  assert.equal(wordsOf(run), "p: moving, 99 %");
  assert.equal(wordsOf({ ...run, phase: "failed", failure: "the bench latched trip" }), "p did not end: the bench latched trip");
  assert.match(wordsOf({ ...run, phase: "done", progress: 1 }), /done, the gates are off/);
  assert.match(wordsOf({ ...run, phase: "resting", progress: 0 }), /gates off until/);
});

// Catches: a bench that is called valid with a late tick or a recording with gaps, a valid one that is not, other words than those
// of the verdict at the end.
test("the verdict so far", () => {
  const status = { mode: pb.Mode.MODE_REALTIME, tick: 1599, late_ticks: 0, worst_lateness_s: 94.81e-6, recording_gaps: 0 };
  assert.deepEqual(verdictOf(status), { text: "real-time valid so far: 1599 ticks, none late, worst lateness 94.8 us", isGood: true });
  assert.deepEqual(verdictOf({ ...status, late_ticks: 2 }), { text: "not real-time valid: 2 of 1599 ticks late, worst lateness 94.8 us", isGood: false });
  const lost = verdictOf({ ...status, mode: pb.Mode.MODE_LOCKSTEP, recording_gaps: 3 });
  assert.deepEqual(lost, { text: "lockstep exact so far: 1599 ticks; the recording lost 3 entries and does not replay", isGood: false });
  assert.ok(verdictOf({ ...status, mode: pb.Mode.MODE_FREE }).text.startsWith("free run exact so far"));
});

// Catches: a transport that is down and not counted, a count under another name.
test("the transports in words", () => {
  const can = { name: "can memory", state: "the bus is off", counts: [{ name: "frames", value: 7 }, { name: "errors", value: 1 }] };
  assert.equal(summaryOf([{ name: "tcp", state: "up", counts: [] }, can]), "Transports: 2, 1 not up");
  assert.equal(summaryOf([{ name: "tcp", state: "up", counts: [] }]), "Transports: 1, all up");
  assert.equal(countsOf(can), "frames 7, errors 1");
});

// Catches: a file of another program that is shown as a result, one of another shape that breaks the page or shows what is no
// number, an interval under another parameter.
test("the report of an identification", () => {
  const report = {
    motor: "dc", method: "least squares", source: "experiment 1", verdict: "the data see every parameter", notes: ["a note", 7],
    parameters: { R: { estimate: 2, unit: "ohm", interval: 0.01, truth: 2.005, inside: true }, L: { estimate: null, unit: "H", interval: null, truth: 0.002, inside: false } },
    validation: { signals: { i_a_a: { unit: "A", rms_error: 0.00123, normalised: 0.025 }, w: { unit: "rad/s", rms_error: 1, normalised: null } }, problem: "" },
  };
  const found = identificationIn(JSON.parse(JSON.stringify(report)));
  assert.deepEqual(found.parameters[0], { name: "R", unit: "ohm", estimate: 2, interval: 0.01, truth: 2.005, inside: true });
  assert.deepEqual(found.parameters.map(isInside), ["yes", "no"]);
  assert.equal(found.validation[0], "simulated again, i_a_a differs by 0.001230 A rms, 2.50 % of it");
  assert.equal(found.validation[1], "simulated again, w differs by 1.000 rad/s rms");
  assert.deepEqual(found.notes, ["a note", ""]);
  for (const other of [null, 7, "dc", [], {}, { motor: "dc" }, { motor: 7, parameters: {} }, { motor: "dc", parameters: [1] }]) assert.equal(identificationIn(other), null);
  const hostile = identificationIn({ motor: "dc", parameters: { __proto__x: 7, R: { estimate: "2", unit: {}, inside: "yes" } }, validation: 7, notes: { a: 1 }, verdict: 8 });
  assert.deepEqual(hostile.parameters[1], { name: "R", unit: "", estimate: null, interval: null, truth: null, inside: null });
  assert.deepEqual([hostile.verdict, hostile.notes], ["", []]);
});

// Catches: a rotor that is drawn so fast that it seems to stand or to turn backwards, and a drawing that keeps silent about it.
test("a fast rotor is drawn slower", () => {
  assert.deepEqual(drawnSpeed(-3), { speed_rad_s: -3, note: "" });
  const { speed_rad_s: drawn, note } = drawnSpeed(-100 * Math.PI);
  assert.ok(Math.abs(drawn + 2 * Math.PI) < 1e-12);
  assert.equal(note, "drawn 50 times slower");
  assert.equal(drawnSpeed(3 * Math.PI).note, "drawn 1.5 times slower");
});

const axisOf = (connection, more = {}) => ({ connection, phases: 3, drive_kind: "averaged_inverter", ...more });

// Catches: commands for a source, currents for a drive without a loop, fields in another unit, a duty of a star that is no half at
// rest, a field winding without its field.
test("a drive asks an axis for what it takes", () => {
  assert.deepEqual(gatesOf(axisOf("star", { drive_kind: "source" })), []);
  assert.deepEqual(gatesOf(axisOf("star", { shares_amplifier_with: "first" })), []);
  assert.deepEqual(gatesOf(axisOf("star")), ["voltage", "duty"]);
  assert.equal(gatesOf(axisOf("star", { drive_kind: "current_amplifier" }))[0], "current");
  assert.deepEqual(wavesOf(axisOf("armature", { phases: 1 })), ["terminals"]);
  const shown = (...what) => fieldsOf(...what).map(({ label, value }) => `${label}=${value}`);
  assert.deepEqual(shown("terminals", "voltage", axisOf("armature", { phases: 1, field_winding: true })),
    ["terminal a, V=0", "field winding, V=0", "ramp, s=1"]);
  assert.deepEqual(shown("terminals", "duty", axisOf("star")), ["terminal a=0.5", "terminal b=0.5", "terminal c=0.5", "ramp, s=1"]);
});

// Catches: another transform than the power-invariant one, a beta that turns backwards, an amplitude that misses its target for
// the boost or for a negative frequency, duties around another value than a half.
test("the targets of a drive", () => {
  const standing = (axis, gates, alpha, beta) => targetOf(1, axis, "standing", gates, { alpha, beta, ramp: 2 });
  const [a, b, c] = standing(axisOf("star"), "voltage", 3, 4).constant;
  assert.ok(Math.abs(a + b + c) < 1e-12 && Math.abs(a * a + b * b + c * c - 25) < 1e-12); // the power of a vector of length 5
  assert.ok(Math.abs(b - c - 4 * Math.sqrt(2)) < 1e-12);
  assert.deepEqual(standing(axisOf("two_phase"), "voltage", 3, 4).constant.slice(0, 2), [3, 4]);
  assert.ok(Math.abs(standing(axisOf("star"), "duty", 0.3, 0).constant[0] - 0.5 - 0.3 * Math.sqrt(2 / 3)) < 1e-12);
  const turning = targetOf(0, axisOf("star"), "rotating", "duty", { frequency: -20, amplitude: 0.4, boost: 0.1, ramp: 1 });
  assert.deepEqual(turning.constant, [0.5, 0.5, 0.5, 0]);
  assert.ok(Math.abs(turning.boost + turning.per_hz * 20 - 0.4) < 1e-12);
  assert.equal(turning.frequency_hz, -20);
});
