// The parts of the page that calculate, bundled for node: needs PAGE_SOURCES and PAGE_PACKAGES in the environment.
import { createRequire } from "node:module";

const { buildSync } = createRequire(`${process.env.PAGE_PACKAGES}/`)("esbuild");
const { outputFiles } = buildSync({
  stdin: {
    contents: ["history", "measurements", "trigger", "capture", "bench", "latenesses", "mcap_export", "numbers", "view", "exports", "curves", "spectrum", "drive_train", "drive_target", "leases", "changes", "preset_rows", "verdict", "transports", "reports/identification", "wire",
      "player/recorded", "player/mcap", "experiments/fetch", "experiments/request", "experiments/words"].map((each) => `export * from "./${each}";`).join("\n"),
    resolveDir: process.env.PAGE_SOURCES, loader: "ts",
  },
  bundle: true, write: false, format: "esm", alias: { long: `${process.env.PAGE_SOURCES}/no_long.js` },
});
export const page = await import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].text).toString("base64")}`);

export function historyOf(ticks, valueOf) {
  const history = new page.History();
  history.choose(["x"]);
  for (const tick of ticks) history.push({ tick, x: valueOf(tick) }, false);
  return history;
}

export const range = (from, to) => Array.from({ length: to - from }, (_, i) => from + i);
