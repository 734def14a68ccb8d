// node view_file.mjs FILE
//
// Writes what a scope shows, two axes for five seconds, as the page does. Needs PAGE_SOURCES and PAGE_PACKAGES as the tests here.
import { writeFileSync } from "node:fs";
import { page } from "./sources.mjs";

const signals = { tick: "1", faults: "bits", encoder_count: "counts", speed_rad_s: "rad/s" };
const description = { name: "made up", period_s: 125e-6, axes: [{ name: "one" }, { name: "two" }],
  signals: Object.entries(signals).map(([name, unit]) => ({ name, unit })) };
const ticks = Float64Array.from({ length: 40_000 }, (_, n) => 1000 + n);
const rows = (columns) => ({ ticks, columns: new Map(Object.entries(columns).map(([name, valueOf]) => [name, ticks.map(valueOf)])) });
const view = { from: 1000, to: 40_999, origin: 0, rows: [
  rows({ speed_rad_s: (tick) => tick / 8, faults: (tick) => tick % 2 }), rows({ encoder_count: (tick) => -tick })] };
const channels = [{ axis: 0, signal: "speed_rad_s" }, { axis: 0, signal: "faults" }, { axis: 1, signal: "encoder_count" }];
const parts = await page.mcapOf({ description }, channels, view);
writeFileSync(process.argv[2], Buffer.from(await new Blob(parts).arrayBuffer()));
