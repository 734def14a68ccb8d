// node --test scope.test.mjs
//
// The scope without a browser: history, trigger, measurements, curves, spectrum, exports. A test's comment names the mistake that it catches.
import assert from "node:assert/strict";
import test from "node:test";
import { historyOf, range, page } from "./sources.mjs";

const { envelope, between, copyOf, measure, Trigger, ticksAround, capturedRows, withCapture, Refused, hasBit, withUnit, numberIn, csvOf, svgOf, timeCurves, xyCurves, spectrumOf, peaksOf,
  barsOf, sentenceOf, mcapOf, sampleSchema, recordedFile, pb, sinceLastGap, amplitude, shareOf, valueOf, logRange, spectrumCurves, amplitudeAt } = page;

// Catches: a spike that decimation loses, one that is drawn at the wrong place or in the wrong order.
test("the envelope keeps a spike of one tick", () => {
  const rows = historyOf(range(0, 100_000), (tick) => (tick === 77_777 ? 5 : tick === 77_778 ? -3 : 0)).rows(0, 100_000);
  const points = envelope(rows, "x", 0, 100_000, 100);
  assert.deepEqual(points.slice(154, 156), [5, -3]);
  assert.ok(points.every((each, i) => each === 0 || i === 154 || i === 155));
});

// Catches: a line that is drawn across samples that were lost, or never sent because a new subscription begins, and one that breaks where the pixels are finer than the ticks.
test("a gap breaks the line, and columns without samples do not", () => {
  for (const isTold of [true, false]) {
    const history = historyOf(range(0, 10), () => 1);
    history.push({ tick: 20, x: 2 }, isTold);
    const points = envelope(history.rows(0, 20), "x", 0, 21, 42);
    assert.equal(points[2], undefined);
    assert.equal(points.filter((each) => each === null).length, 2);
    assert.equal(points.indexOf(null) >> 1, 39);
  }
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

// Catches: a bit beyond 32 that is lost.
test("bits of large words", () => {
  assert.ok(hasBit(2 ** 40 + 1, 2 ** 40) && !hasBit(2 ** 41, 2 ** 40));
});

// Catches: a window that is larger than the server keeps and is refused, one without the tick of the event, more before than asked.
test("the ticks of a capture", () => {
  assert.deepEqual(ticksAround(0.2, 1000, 3), { ticks_before: 200, ticks_after: 801 });
  assert.deepEqual(ticksAround(1, 1000, 3), { ticks_before: 1000, ticks_after: 1 });
  assert.deepEqual(ticksAround(0, 2, 1), { ticks_before: 0, ticks_after: 3 });
  for (const channels of [1, 8, 15, 16, 63]) {
    const { ticks_before: before, ticks_after: after } = ticksAround(0.5, 240_000, channels);
    assert.ok(before + after <= 65536 && (before + after) * (1 + channels) <= 1 << 20);
    assert.ok((before + after + 1) * (1 + channels) > 1 << 20 || before + after === 65536, "not the largest");
    assert.ok(Math.abs(before - after) <= 1);
  }
});

// Catches: a gap over which a line is drawn, values of another channel or axis.
test("the rows of a capture", () => {
  const rows = capturedRows(Float64Array.from([5, 1, 10, 6, 2, NaN, 9, 3, 30]), [{ axis: 1, signal: "x" }, { axis: 0, signal: "y" }]);
  assert.deepEqual([...rows.keys()], [1, 0]);
  assert.deepEqual([...rows.get(1).ticks], [5, 6, 8.5, 9]);
  assert.deepEqual([...rows.get(1).columns.get("x")], [1, 2, NaN, 3]);
  assert.deepEqual([...rows.get(0).columns.get("y")], [10, NaN, NaN, 30]);
});

// Catches: samples that the page has lost and that stay lost, samples twice or in disorder where both meet, a signal that was
// not captured and disappears.
test("a capture takes the place of what the page has", () => {
  const rows = historyOf([0, 1, 2, 4, 7, 8, 9], (tick) => tick).rows(0, 9);
  rows.columns.set("y", Float64Array.from(rows.ticks, (tick) => 10 * tick));
  const captured = { tick: 5, rows: capturedRows(Float64Array.from([2, 102, 3, 103, 4, 104, 5, 105, 6, 106, 7, 107]), [{ axis: 0, signal: "x" }]) };
  const view = withCapture({ from: 0, to: 9, origin: 5, rows: [rows, historyOf([3], () => 1).rows(0, 9)] }, captured);
  assert.deepEqual([...view.rows[0].ticks], range(0, 10));
  assert.deepEqual([...view.rows[0].columns.get("x")], [0, 1, 102, 103, 104, 105, 106, 107, 8, 9]);
  assert.deepEqual([...view.rows[0].columns.get("y")], [0, 10, 20, NaN, 40, NaN, NaN, 70, 80, 90]);
  assert.deepEqual([...view.rows[1].ticks], [3]);
  const part = withCapture({ from: 3, to: 4, origin: 5, rows: [historyOf([3], () => 3).rows(3, 4)] }, captured);
  assert.deepEqual([...part.rows[0].ticks], [3, 4]);
});

/** A server that answers each request when it is told to. */
function fakeServer(rowsOf) {
  const server = { asked: [], open: [] };
  server.ask = (kind, goesOn = () => false) => new Promise((resolve, reject) => {
    server.asked.push(kind);
    const read = kind.read_capture;
    const answer = () => {
      const answered = read === undefined ? { done: {} } : { capture_rows: { first_row: read.first_row, data: rowsOf(read.first_row) } };
      goesOn(answered);
      resolve(answered);
    };
    if (kind.trigger) server.open.push({ answer, refuse: (message) => reject(new Refused({ message })) });
    else answer();
  });
  return server;
}

const settled = () => new Promise((done) => setTimeout(done));

// Catches: a request without the signal of the trigger, an event of another setting that is shown, one between two that is lost, pieces in a
// wrong place or too many requests at once, a single trigger that stays armed, the server's words for a refusal that nobody sees.
test("the trigger asks the server and fetches what it has kept", async () => {
  const bytes = (first, count) => new Uint8Array(Float64Array.from(range(first, Math.min(first + count, 50)).flatMap((row) => [row, 10 * row])).buffer);
  const server = fakeServer((first) => bytes(first, 4));
  let changes = 0;
  const trigger = new Trigger(server, () => ++changes);
  trigger.settings = { ...trigger.settings, condition: "bit", axis: 1, signal: "faults", level: 2 ** 40, holdOffTicks: 30 };
  trigger.arm([], 100);
  trigger.arm([{ axis: 1, signal: "faults" }], 100);
  const { bits, condition, captured, hold_off_ticks: holdOff, ticks_before: before } = server.asked[0].trigger;
  assert.deepEqual([bits, condition, captured, holdOff, before], [2 ** 40, 7, [{ axis: 1, signals: ["faults"] }], 30, 20]);
  assert.deepEqual(server.asked[1].trigger.captured, captured);
  server.open[0].answer();
  trigger.take({ capture: 1, tick: 5, complete: true, rows: 3 });
  assert.equal(trigger.firedTick, null, "of the first setting");
  server.open[1].answer();
  trigger.take({ capture: 2, tick: 20, complete: false });
  assert.deepEqual([trigger.firedTick, trigger.captured], [20, null]);
  trigger.take({ capture: 2, tick: 20, complete: true, rows: 50, missed_events: 2 });
  await settled();
  assert.deepEqual([...trigger.captured.rows.get(1).columns.get("faults")], range(0, 50).map((row) => 10 * row));
  assert.deepEqual([trigger.isArmed, trigger.firedTick, trigger.missedEvents, server.asked.length], [true, null, 2, 2 + 13]);
  assert.ok(trigger.holdsOff(20) && trigger.holdsOff(48) && !trigger.holdsOff(49) && !trigger.holdsOff(19));
  trigger.settings.sweep = "single";
  trigger.arm([], 100);
  server.open[2].answer();
  trigger.take({ capture: 3, tick: 90, complete: true, rows: 50 });
  await settled();
  assert.deepEqual([trigger.isArmed, trigger.captured.tick], [false, 90]);
  trigger.arm([], 100);
  server.open[3].refuse("the sessions have 32 triggers");
  await settled();
  assert.deepEqual([trigger.isArmed, trigger.problem, changes], [false, "the sessions have 32 triggers", 6]);
  trigger.end();
  assert.equal(server.asked.filter((each) => each.trigger).length, 4, "nothing to end");
});

// Catches: a capture that is thrown away because the next event comes in one message with its last piece, or that ends this event.
test("the next event with the last piece of a capture", async () => {
  const server = fakeServer(() => new Uint8Array(Float64Array.of(4, 40).buffer));
  const trigger = new Trigger(server, () => {});
  trigger.settings = { ...trigger.settings, condition: "above", signal: "x" };
  trigger.arm([], 100);
  server.open[0].answer();
  trigger.take({ capture: 1, tick: 5, complete: true, rows: 1 });
  trigger.take({ capture: 2, tick: 6, complete: false });
  await settled();
  assert.deepEqual([trigger.captured?.tick, trigger.firedTick, trigger.isArmed], [5, 6, true]);
});

// Catches: the refusal of an older setting that comes in one message with the answer to the newest, and is shown as the newest's; an
// event in the same message that is taken for one of the older setting.
test("a refusal and the answer to the next setting in one message", async () => {
  const server = fakeServer(() => []);
  const trigger = new Trigger(server, () => {});
  trigger.settings = { ...trigger.settings, condition: "leaves", signal: "injected", upper: NaN };
  trigger.arm([], 100);
  trigger.settings = { ...trigger.settings, upper: 0 };
  trigger.arm([], 100);
  server.open[0].refuse("upper is not a finite number");
  server.open[1].answer();
  trigger.take({ capture: 1, tick: 5, complete: false });
  assert.deepEqual([trigger.isArmed, trigger.firedTick, trigger.problem], [true, 5, ""]);
  await settled();
  assert.deepEqual([trigger.isArmed, trigger.firedTick, trigger.problem], [true, 5, ""]);
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

// Catches: a bar of another octave, one late tick among millions that is not seen, a late octave in the colour of the others.
test("the bars of the latenesses", () => {
  const counts = new Array(32).fill(0);
  counts[3] = 1e6;
  counts[10] = 1;
  const bars = barsOf(counts, 125e-6);
  assert.deepEqual([bars.length, bars[0].belowS, bars[7].belowS, bars[1].height], [8, 1e-6, 128e-6, 0]);
  assert.deepEqual([bars[0].height, bars[0].isLate, bars[7].isLate], [1, false, true]);
  assert.ok(bars[7].height > 0.04);
  assert.match(sentenceOf(bars), /1000000 below 1\.000 µs, 1 below 128\.0 µs/);
  assert.deepEqual(barsOf(new Array(32).fill(0), 1), []);
});

// Catches: a file that our own reader refuses, an axis in the place of another, a tick that is left out or comes twice, signals in the schema
// that nobody saw, a gap that becomes a sample.
test("an MCAP file of the view", async () => {
  const description = { name: "bench", period_s: 1e-3, axes: [{ name: "one" }, { name: "two" }],
    signals: [["tick", "ticks"], ["faults", "bits"], ["encoder_count", "counts"], ["speed_rad_s", "rad/s"]].map(([name, unit]) => ({ name, unit })) };
  const rows = (ticks, columns) => ({ ticks: Float64Array.from(ticks), columns: new Map(Object.entries(columns).map(([name, values]) => [name, Float64Array.from(values)])) });
  const view = { from: 4, to: 7, origin: 0, rows: [
    rows([4, 5, 5.5, 7], { speed_rad_s: [1.5, -2.5, NaN, 4], faults: [0, 2 ** 40, NaN, 1] }), rows([5, 6], { encoder_count: [-7, 8] })] };
  const channels = [{ axis: 1, signal: "encoder_count" }, { axis: 0, signal: "speed_rad_s" }, { axis: 0, signal: "faults" }, { axis: 0, signal: "speed_rad_s" }];
  const bytes = new Uint8Array(await new Blob(await mcapOf({ description, histories: [] }, channels, view)).arrayBuffer());
  const read = recordedFile(description, bytes);
  assert.deepEqual(read.description.axes.map((each) => each.name), ["two", "one"]);
  assert.equal(read.description.period_s, 1e-3);
  const [two, one] = read.histories;
  one.choose(["speed_rad_s", "faults"]);
  two.choose(["encoder_count"]);
  assert.deepEqual([[...one.ticks], [...two.ticks]], [[4, 5, 7], [5, 6]]);
  assert.deepEqual([...one.column("speed_rad_s"), ...one.column("faults"), ...two.column("encoder_count")], [1.5, -2.5, 4, 0, 2 ** 40, 1, -7, 8]);
  const many = range(0, 50_000);
  const long = { ...view, rows: [rows(many, { speed_rad_s: many.map((tick) => 2 * tick), faults: many })] }; // some chunks
  const [again] = recordedFile(description, new Uint8Array(await new Blob(await mcapOf({ description }, channels.slice(1), long)).arrayBuffer())).histories;
  again.choose(["speed_rad_s"]);
  assert.deepEqual([[...again.ticks], [...again.column("speed_rad_s")]], [many, many.map((tick) => 2 * tick)]);
  const schema = Buffer.from(sampleSchema(["tick", "encoder_count"])).toString("latin1");
  assert.ok(schema.includes("encoder_count") && !schema.includes("speed"));
  const typeOf = (signal) => Buffer.from(sampleSchema([signal])).toString("latin1").match(/\x20\x01\x28(.)/s)[1].charCodeAt(0);
  assert.deepEqual(["tick", "encoder_count", "speed_rad_s"].map(typeOf), [4, 18, 1]); // uint64, sint64, double
  const [alone] = recordedFile(description, new Uint8Array(await new Blob(await mcapOf({ description }, [{ axis: 0, signal: "tick" }], view)).arrayBuffer())).histories;
  assert.deepEqual([...alone.ticks], [4, 5, 7]);
});
