// node --test scope.test.mjs
//
// The scope without a browser: history, trigger, measurements, curves, spectrum, exports. A test's comment names the mistake that it catches.
import assert from "node:assert/strict";
import test from "node:test";
import { historyOf, range, page } from "./sources.mjs";

const { envelope, between, copyOf, measure, fires, Trigger, hasBit, withUnit, numberIn, csvOf, svgOf, timeCurves, xyCurves, spectrumOf, peaksOf,
  sinceLastGap, amplitude, shareOf, valueOf, logRange, spectrumCurves, amplitudeAt } = page;

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
