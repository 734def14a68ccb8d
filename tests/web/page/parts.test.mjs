// node --test parts.test.mjs, with PAGE_SOURCES and PAGE_PACKAGES in the environment.
//
// The parts of the page that calculate, without a browser. A test's comment names the mistake that it catches.
import assert from "node:assert/strict";
import { createRequire } from "node:module";
import test from "node:test";

const { buildSync } = createRequire(`${process.env.PAGE_PACKAGES}/`)("esbuild");
const { outputFiles } = buildSync({
  stdin: {
    contents: ["history", "measurements", "trigger", "numbers", "view", "exports", "curves", "spectrum", "drive_train", "drive_target", "preset_rows", "verdict", "transports", "reports/identification", "wire",
      "player/recorded", "player/mcap", "experiments/fetch", "experiments/request", "experiments/words"].map((each) => `export * from "./${each}";`).join("\n"),
    resolveDir: process.env.PAGE_SOURCES, loader: "ts",
  },
  bundle: true, write: false, format: "esm", alias: { long: `${process.env.PAGE_SOURCES}/no_long.js` },
});
const { History, envelope, between, copyOf, measure, fires, Trigger, wordsOf, verdictOf, summaryOf, countsOf, identificationIn, isInside, hasBit, withUnit, numberIn, csvOf, svgOf, timeCurves, xyCurves,
  spectrumOf, peaksOf, sinceLastGap, amplitude, drawnSpeed, gatesOf, wavesOf, fieldsOf, targetOf, pb, Track,
  recordedRows, recordedFile, csvOfRows, Pieces, shareOf, valueOf, logRange, spectrumCurves, amplitudeAt, inputsOf, channelsOf, fieldsOfShape, shapeOf, eventOf, identification,
  fetchExperiment, RequestKeys, fileNameOf, factsOf, arrivalOf } =
  await import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].text).toString("base64")}`);

function historyOf(ticks, valueOf) {
  const history = new History();
  history.choose(["x"]);
  for (const tick of ticks) history.push({ tick, x: valueOf(tick) }, false);
  return history;
}

const range = (from, to) => Array.from({ length: to - from }, (_, i) => from + i);

// Catches: a spike that decimation loses, one that is drawn at the wrong place or in the wrong order.
test("the envelope keeps a spike of one tick", () => {
  const rows = historyOf(range(0, 100_000), (tick) => (tick === 77_777 ? 5 : tick === 77_778 ? -3 : 0)).rows(0, 100_000);
  const points = envelope(rows, "x", 0, 100_000, 100);
  assert.deepEqual(points.slice(154, 156), [5, -3]);
  assert.ok(points.every((each, i) => each === 0 || i === 154 || i === 155));
});

// Catches: a line that is drawn across samples that were lost, and one that breaks where the pixels are finer than the ticks.
test("a gap breaks the line, and columns without samples do not", () => {
  const history = historyOf(range(0, 10), () => 1);
  history.push({ tick: 20, x: 2 }, true);
  const points = envelope(history.rows(0, 20), "x", 0, 21, 42);
  assert.equal(points[2], undefined);
  assert.equal(points.filter((each) => each === null).length, 2);
  assert.equal(points.indexOf(null) >> 1, 39);
});

// Catches: a ring that mixes old and new samples where it begins again, and a run that goes on in the window of the last.
test("the history is one window across its end, and begins anew with the bench", () => {
  const history = historyOf(range(0, 300_000), (tick) => tick);
  const rows = history.rows(250_000, 299_999);
  assert.equal(rows.ticks.length, 50_000);
  assert.ok(rows.ticks.every((tick, i) => tick === 250_000 + i && rows.columns.get("x")[i] === tick));
  assert.equal(history.rows(0, 1000).ticks.length, 0);
  history.push({ tick: 5, x: 1 }, false);
  assert.deepEqual([...history.rows(0, 1e9).ticks], [5]);
});

// Catches: a picture on hold that the samples after it change.
test("a copy stays as it is", () => {
  const history = historyOf(range(0, 10), () => 1);
  const copy = copyOf(history.rows(0, 9));
  for (const tick of range(10, 600_000)) history.push({ tick, x: 2 }, false);
  assert.deepEqual([...copy.columns.get("x")], Array(10).fill(1));
  assert.deepEqual([...between(copy, 3, 5).ticks], [3, 4, 5]);
});

// Catches: a factor of sqrt(2), a mean over the gaps, a frequency that noise doubles or the window's ends shift.
test("measurements of a noisy sine with a gap", () => {
  const ticks = Float64Array.from(range(0, 8000).filter((tick) => tick < 3000 || tick > 3100));
  const values = ticks.map((tick) => 1 + 2 * Math.sin(2 * Math.PI * 50 * tick / 8000) + 0.1 * Math.sin(tick * 12.9898));
  values[2500] = NaN;
  const m = measure(values, ticks, 1 / 8000);
  assert.ok(Math.abs(m.mean - 1) < 0.03);
  assert.ok(Math.abs(m.rms - Math.sqrt(3)) < 0.03);
  assert.ok(Math.abs(m.peakToPeak - 4.2) < 0.05);
  assert.ok(Math.abs(m.frequency - 50) < 0.2);
  assert.ok(Number.isNaN(measure(new Float64Array(0), ticks, 1).mean));
  assert.ok(Number.isNaN(measure(Float64Array.from([1, 1, 1]), ticks, 1).frequency));
});

// Catches: an edge that fires on the first sample, on a touch from the wrong side, or twice; a bit beyond 32; a band whose ends lie
// outside, that fires on the first sample or twice, or on a jump from one side to the other; a state that lasts.
test("the conditions of the trigger", () => {
  const when = (condition, level, upper = 0) => (previous, value) => fires({ condition, level, upper }, previous, value);
  const [rising, falling, above, below] = ["rising", "falling", "above", "below"].map((each) => when(each, 1));
  assert.ok(rising(0.9, 1) && !rising(1, 1.1) && !rising(NaN, 2));
  assert.ok(falling(1.1, 1) && !falling(1, 0.9));
  assert.ok(above(NaN, 2) && !above(NaN, 1));
  assert.ok(below(NaN, 0) && !below(NaN, 1));
  const leaves = when("leaves", -1, 2);
  assert.ok(leaves(2, 2.1) && leaves(-1, -1.1) && leaves(0, 9));
  assert.ok(!leaves(NaN, 9) && !leaves(9, 8) && !leaves(9, -9) && !leaves(0, 2) && !leaves(0, NaN));
  const enters = when("enters", -1, 2);
  assert.ok(enters(2.1, 2) && enters(-9, -1) && !enters(NaN, 0) && !enters(0, 1) && !enters(-9, 9) && !enters(0, 9));
  const bit = when("bit", 4);
  assert.ok(bit(1, 5) && !bit(4, 4) && !bit(NaN, 4));
  const state = when("state", 4);
  assert.ok(state(1, 4) && !state(4, 4) && !state(NaN, 4) && !state(4, 1));
  assert.ok(!when("off", 1)(0, 1));
  assert.ok(hasBit(2 ** 40 + 1, 2 ** 40) && !hasBit(2 ** 41, 2 ** 40));
});

// Catches: an event of one tick that a rate of drawing decides about, a hold-off of other ticks, one that begins at the end of the
// capture, that outlasts the run of the bench or a new setting, an edge of the hold-off that counts afterwards.
test("the hold-off of the trigger", () => {
  const trigger = new Trigger();
  trigger.settings = { ...trigger.settings, condition: "leaves", signal: "x", level: -1, upper: 1, holdOffTicks: 100 };
  const fired = (ticks, xOf) => {
    const found = [];
    for (const tick of ticks) {
      trigger.see(0, { tick, x: xOf(tick) });
      if (trigger.firedTick === null) continue;
      found.push(trigger.firedTick);
      trigger.armAgain();
    }
    return found;
  };
  trigger.arm();
  const every = (period) => (tick) => (tick % period === 7 ? 5 : 0); // for one tick
  assert.deepEqual(fired(range(0, 1000), every(30)), [7, 127, 247, 367, 487, 607, 727, 847, 967]);
  assert.deepEqual(fired(range(1000, 1100), (tick) => (tick === 1066 ? 5 : 0)), []); // 967 + 99
  assert.deepEqual(fired(range(1100, 1102), (tick) => (tick === 1101 ? 5 : 0)), [1101]);
  assert.deepEqual(fired(range(0, 60), every(50)), [7]); // the bench was reset
  assert.deepEqual(fired(range(60, 300), (tick) => (tick >= 90 && tick < 120 ? 5 : 0)), []);
  trigger.arm();
  assert.deepEqual(fired(range(300, 320), every(50)), [307]);
  trigger.arm();
  assert.deepEqual(fired(range(320, 340), (tick) => (tick === 330 ? 5 : 0)), [330]);
});

// Catches: a common voltage of the terminals that counts as amplitude, the sum of three phases for their vector.
test("the amplitude of terminals", () => {
  const three = (angle) => [0, 1, 2].map((phase) => 24 + 10 * Math.cos(angle - (phase * 2 * Math.PI) / 3));
  for (const angle of [0, 0.4, 2]) assert.ok(Math.abs(amplitude(three(angle)) - 10) < 1e-12);
  assert.equal(amplitude([3, -4]), 5);
  assert.equal(amplitude([-6]), -6);
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

// Catches: 8.5e-170 for nothing, a prefix for a count, a word that is read as a number.
test("numbers for people", () => {
  assert.equal(withUnit(0.0123, "A"), "12.30 mA");
  assert.equal(withUnit(-1234.5, "V"), "-1.234 kV".replace("1.234", (1.2345).toPrecision(4)));
  assert.equal(withUnit(8.5e-170, "A"), "0 A");
  assert.equal(withUnit(1234567, "counts"), "1234567 counts");
  assert.equal(withUnit(NaN, "A"), "–");
  for (const word of ["", "much", "1,5", "0x10", "1e", "Infinity", "NaN", "--1"]) assert.ok(Number.isNaN(numberIn(word)), word);
  assert.equal(numberIn(" -2.5e-3 "), -0.0025);
});

// Catches: columns under the wrong title, rows of gaps, and an SVG that a title can break.
test("exports of two axes", async () => {
  const rows = [historyOf(range(0, 4), (tick) => tick), historyOf([1, 3], () => 7)].map((each) => each.rows(0, 10));
  const view = { from: 0, to: 4, origin: 0, rows };
  const channels = [{ axis: 0, signal: "x", title: "a.x [A]" }, { axis: 1, signal: "x", title: "b.x [A]" }];
  assert.equal((await csvOf(channels, view, 0.5)).join(""), "tick,time_s,a.x [A],b.x [A]\n0,0,0,\n1,0.5,1,7\n2,1,2,\n3,1.5,3,7\n");
  const { x, lines } = timeCurves(view, [channels[0]], 0.5, 100);
  const svg = svgOf([{ x, labels: { x: "time [s]", y: "[A]" }, logarithmic: { x: false, y: false }, lines: [{ ...lines[0], title: "<b>&", colour: "red" }] }]);
  assert.match(svg, /&lt;b>&amp;/);
  assert.match(svg, /<path d="M[0-9.]+ [0-9.]+L/);
});

const sine = (count, amplitude, frequency, rate, mean = 0) =>
  Float64Array.from(range(0, count), (i) => mean + amplitude * Math.sin((2 * Math.PI * frequency * i) / rate + 0.7));

// Catches: a factor of 2 for the negative frequencies or of the window, a step of the wrong width, an amplitude that depends on
// where between two steps the sine lies, a mean that counts as a low frequency.
test("a sine has its amplitude at its frequency, and the shape of the Hann window around it", () => {
  const [count, rate, amplitude] = [3000, 8000, 2.5];
  for (const frequency of [400, 401, 401.333, 402.7]) {
    const spectrum = spectrumOf(sine(count, amplitude, frequency, rate, 10), 1 / rate);
    spectrum.amplitudes.forEach((shown, k) => {
      const d = ((k * spectrum.stepHz - frequency) * count) / rate; // in bins
      const isSpecial = Math.abs(d) < 1e-9 || Math.abs(Math.abs(d) - 1) < 1e-9;
      const shape = isSpecial ? (Math.abs(d) < 0.5 ? 1 : 0.5) : Math.sin(Math.PI * d) / (Math.PI * d * (1 - d * d));
      // The image at the negative frequency adds (2 · 150 bins)^-3 here.
      assert.ok(Math.abs(shown - amplitude * Math.abs(shape)) < 1e-5 * amplitude, `${frequency} Hz, step ${k}`);
    });
    const [peak] = peaksOf(spectrum, 5);
    // The parabola errs by less than this at this width of the steps, 0.37 of a bin.
    assert.ok(Math.abs(peak.amplitude / amplitude - 1) < 1e-4, `${frequency} Hz: ${peak.amplitude}`);
    assert.ok(Math.abs(peak.frequency - frequency) < (1e-3 * rate) / count, `${frequency} Hz: ${peak.frequency}`);
  }
});

// Catches: side lobes that are named as harmonics, peaks in the wrong order, a small one that a large one hides.
test("harmonics are the largest peaks", () => {
  const parts = [[10, 50.3], [0.5, 251.5], [1, 352.1]];
  const values = sine(8000, 0, 0, 8000).map((_, i) => parts.reduce((sum, [a, f]) => sum + a * Math.sin((2 * Math.PI * f * i) / 8000), 0));
  const peaks = peaksOf(spectrumOf(values, 1 / 8000), 4);
  [[10, 50.3], [1, 352.1], [0.5, 251.5]].forEach(([amplitude, frequency], i) => {
    assert.ok(Math.abs(peaks[i].amplitude / amplitude - 1) < 1e-3 && Math.abs(peaks[i].frequency - frequency) < 0.01);
  });
  assert.ok(peaks.length < 4 || peaks[3].amplitude < 1e-3);
});

// Catches: a gap that counts as zeros, or takes all of the spectrum with it.
test("the spectrum is that of the samples after the last gap", () => {
  assert.deepEqual([...sinceLastGap(Float64Array.from([1, NaN, 2, 3]))], [2, 3]);
  assert.equal(sinceLastGap(Float64Array.from([1, NaN])).length, 0);
  assert.equal(spectrumOf(new Float64Array(15), 1), null);
});

// Catches: samples of different ticks in one point, x and y exchanged, a spike that the XY view leaves out.
test("XY pairs the samples of the same ticks", () => {
  const rows = [historyOf(range(0, 6), (tick) => tick), historyOf([1, 2, 4, 7], (tick) => 10 * tick)].map((each) => each.rows(0, 10));
  const view = { from: 0, to: 10, origin: 0, rows };
  rows[0].columns.set("y", rows[0].ticks.map((tick) => 2 * tick));
  const { lines } = xyCurves(view, [{ axis: 0, signal: "x" }, { axis: 1, signal: "x" }, { axis: 0, signal: "y" }]);
  assert.deepEqual(lines.map(({ x, y }) => [[...x], [...y]]),
    [[[1, 2, 4], [10, 20, 40]], [range(0, 6), range(0, 6).map((tick) => 2 * tick)]]);
  assert.deepEqual(xyCurves(view, []).lines, []);
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

// Catches: a logarithm of 0 that leaves the picture, a range that cuts the largest value or is empty, an axis that begins at 0.
test("logarithmic axes", () => {
  assert.deepEqual([1, 10, 100, 0, -5].map((each) => shareOf(each, [1, 100], true)), [0, 0.5, 1, 0, 0]);
  assert.deepEqual([0, 0.5, 1].map((each) => Math.round(valueOf(each, [1, 100], true))), [1, 10, 100]);
  assert.equal(valueOf(0.5, [1, 100], false), 50.5);
  assert.deepEqual(logRange("y", [0.02, 169]), [0.01, 1000]);
  assert.deepEqual(logRange("y", [0, 169]), [0.001, 1000]);
  assert.deepEqual(logRange("x", [0.25, 500]), [0.25, 500]);
  assert.deepEqual(logRange("x", [1e-9, 500]), [0.05, 500]);
  for (const extent of [[0, 0], [0, 1], [5, 5]]) {
    const [low, high] = logRange("y", extent);
    assert.ok(low > 0 && high > low && high >= extent[1]);
  }
});

// Catches: the cursor of a spectrum beside the step at which it stands.
test("the amplitude at the cursor of a spectrum", () => {
  const spectrum = spectrumOf(Float64Array.from(range(0, 1000), (tick) => 3 * Math.sin(2 * Math.PI * 0.125 * tick)), 0.001);
  assert.ok(Math.abs(amplitudeAt(spectrum, 125) - 3) < 0.12);
  assert.ok(amplitudeAt(spectrum, 200) < 1e-3);
  assert.ok(Number.isNaN(amplitudeAt(spectrum, 1000)));
  const channels = [{ axis: 0, signal: "x" }];
  assert.deepEqual(spectrumCurves([spectrum], channels, 500, false).x, [0, 500]);
  assert.deepEqual(spectrumCurves([spectrum], channels, 500, true).x, [spectrum.stepHz, 500]);
});
