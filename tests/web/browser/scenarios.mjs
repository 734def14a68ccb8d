// node scenarios.mjs NAME URL [ARGUMENTS]
//
// Opens the page of `drivebench web` in chromium, does what a user would and prints one JSON object with what the page then
// shows. A line "ask WHAT" asks the test to do something outside, and waits for a line on standard input.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { createInterface } from "node:readline";
import puppeteer from "puppeteer-core";
import { driveScenarios } from "./drive_scenarios.mjs";
import { experimentScenarios } from "./experiment_scenarios.mjs";
import { reportScenarios } from "./report_scenarios.mjs";
import { runScenarios } from "./run_scenarios.mjs";

const kPatienceMs = 60_000;
const lines = createInterface({ input: process.stdin })[Symbol.asyncIterator]();

async function outside(what) {
  console.log(`ask ${what}`);
  await lines.next();
}

/** Asks again and again until the text matches; the page's own policy forbids to evaluate texts in it. */
async function until(find, pattern) {
  for (const end = Date.now() + kPatienceMs; ;) {
    const shown = await find();
    if (shown !== undefined && pattern.test(shown)) return shown;
    if (Date.now() > end) throw new Error(`still '${shown}', not ${pattern}`);
    await new Promise((done) => setTimeout(done, 50));
  }
}

const text = (page, selector, pattern = /./) =>
  until(() => page.evaluate((where) => document.querySelector(where)?.textContent, selector), pattern);

/** The value beside a name in the state of the bench or of its axis. */
const stateOf = (page, name, pattern = /./) => until(() => page.evaluate((wanted) =>
  [...document.querySelectorAll("#state dt")].find((each) => each.textContent === wanted)?.nextElementSibling.textContent,
name), pattern);

async function set(page, label, value, within = page) {
  await within.$eval(`[aria-label="${label}"]`, (field, wanted) => {
    field.value = wanted;
    field.dispatchEvent(new Event(field.type === "range" ? "input" : "change", { bubbles: true }));
  }, value);
}

const press = (page, words) => page.evaluate((wanted) =>
  [...document.querySelectorAll("button")].find((each) => (each.ariaLabel ?? each.textContent) === wanted).click(), words);

/** The panes of the scope, as soon as there are any. */
async function panesOf(page) {
  await page.waitForSelector(".pane", { timeout: kPatienceMs });
  return page.$$(".pane");
}

/** Sets the kind of a pane. */
const kind = (pane, value) => pane.$eval('[aria-label="kind of this pane"]', (field, wanted) => {
  field.value = wanted;
  field.dispatchEvent(new Event("change"));
}, value);

/** Adds a signal to a pane. */
const add = (pane, signal) => pane.$eval('[aria-label="add a signal to this pane"]', (field, wanted) => {
  field.value = wanted;
  field.dispatchEvent(new Event("change"));
}, signal);

/** The cells of a row of measurements by its signal. */
const measured = (page, signal) => page.evaluate((wanted) => {
  const row = [...document.querySelectorAll(".measurements tbody tr")].find((each) => each.querySelector("th").textContent === wanted);
  const heads = [...document.querySelectorAll(".measurements thead th")].map((each) => each.textContent);
  return row && Object.fromEntries([...row.children].map((cell, i) => [heads[i], cell.textContent]));
}, signal);

/** Shows the token for which the page asks. */
async function enter(page, token) {
  const asked = await text(page, "#alert", /token/);
  await page.type("#token", token);
  await page.keyboard.press("Enter");
  return asked;
}

const isShown = (page, selector) => page.evaluate((where) => !document.querySelector(where).hidden, selector);

/** The files that the page offers from now on, by their names. */
async function catchFiles(page) {
  await page.evaluate(() => {
    window.offered = {};
    const blobs = {};
    const make = URL.createObjectURL.bind(URL);
    URL.createObjectURL = (blob) => {
      const url = make(blob);
      blobs[url] = blob;
      return url;
    };
    HTMLAnchorElement.prototype.click = async function click() {
      window.offered[this.download] = await blobs[this.href].text();
    };
  });
  return (pattern) => until(async () => {
    const offered = await page.evaluate(() => window.offered);
    return Object.entries(offered).map(([name, content]) => `${name}\n${content}`).find((each) => pattern.test(each));
  }, /./);
}

/** A single trigger on a fault that appears; its state. */
async function armOnFault(page) {
  await stateOf(page, "tick", /[1-9]/);
  await set(page, "window", "0.5");
  await set(page, "trigger condition", "bit");
  await page.evaluate(() => {
    const bits = document.querySelector('[aria-label="trigger bit"]');
    bits.value = [...bits.options].find((each) => each.textContent.endsWith("injected open_phase")).value;
    bits.dispatchEvent(new Event("change"));
  });
  await set(page, "trigger sweep", "single");
  return text(page, '[aria-label="trigger state"]', /armed/);
}

/** The fault, half a second of the bench later, for one tick; the bench's answer. */
async function injectForATick(page) {
  await set(page, "fault", "open_phase");
  await set(page, "value of the fault", "1");
  await set(page, "ticks that the fault lasts; 0: until it is ended", "1");
  await press(page, "Inject");
  const answer = await text(page, "#knobs .answer", /:/);
  if (!answer.includes("done")) throw new Error(answer);
  return answer;
}

/** What axe-core says against the page, in both themes. */
async function axeFinds(page) {
  const source = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
  const found = [];
  for (const theme of ["light", "dark"]) {
    await page.evaluate((chosen) => { document.documentElement.dataset.theme = chosen; }, theme);
    await page.evaluate(source);
    const { violations } = await page.evaluate(() => window.axe.run());
    found.push(...violations.map(({ id, impact, nodes }) => ({ theme, id, impact, nodes: nodes.slice(0, 3).map((each) => each.html) })));
  }
  return { found };
}

/** A picture of the part of the page from one section to another, in a theme. */
async function pictureOf(page, theme, path, first, last) {
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: theme }]);
  await new Promise((done) => setTimeout(done, 1000));
  const clip = await page.evaluate((from, to) => {
    scrollTo(0, 0); // the head stays above the picture
    const [begin, end] = [from, to].map((each) => document.querySelector(each).getBoundingClientRect());
    return { x: begin.left - 8, y: begin.top - 8, width: Math.max(begin.width, end.width) + 16, height: end.bottom - begin.top + 16 };
  }, first, last);
  await page.screenshot({ path, clip, captureBeyondViewport: true });
}

const scenarios = {
  ...driveScenarios({ axeFinds, enter, outside, pictureOf, press, set, stateOf, text, until }),
  ...reportScenarios({ axeFinds, press, text }),
  ...runScenarios({ axeFinds, enter, pictureOf, press, set, stateOf, text, until }),
  ...experimentScenarios({ axeFinds, catchFiles, enter, isShown, pictureOf, press, set, stateOf, text, until }),

  /** A user opens the page and looks. */
  async look(page) {
    await stateOf(page, "speed", /^[1-9]/);
    const row = await until(async () => JSON.stringify(await measured(page, "speed_rad_s") ?? {}), /"maximum":"[1-9]/);
    const file = await catchFiles(page);
    await press(page, "Pause");
    await press(page, "CSV");
    await press(page, "SVG");
    return {
      name: await text(page, "#bench-name"), facts: await text(page, "#bench-facts"), link: await text(page, "#link-state"),
      verdict: await stateOf(page, "verdict"), transports: await text(page, "#state details summary"),
      counts: await text(page, "#state details dd .soft"), speed: JSON.parse(row), plots: (await page.$$(".pane canvas")).length, knobs: await isShown(page, "#knobs"),
      csv: (await file(/\.csv/)).split("\n").slice(0, 4), svg: (await file(/\.svg/)).slice(0, 200),
    };
  },

  /** The drawing of the drive train while the motor turns. */
  async train(page) {
    await stateOf(page, "speed", /^[1-9]/);
    const shown = async (name) => text(page, `.train .${name}`, /./);
    const rotor = () => page.$eval(".train .rotor", (each) => each.getAttribute("transform"));
    const note = await shown("note");
    const angles = new Set();
    for (let i = 0; i < 20; ++i) {
      angles.add(await rotor());
      await new Promise((done) => setTimeout(done, 50));
    }
    const titles = await page.$$eval(".train > .title", (all) => all.map((each) => each.textContent));
    const values = {};
    for (const name of ["voltage", "current", "torque", "load", "speed"]) values[name] = await shown(name);
    return { note, angles: angles.size, titles, values };
  },

  /** A pane of currents becomes a locus, one of voltages a spectrum. */
  async kinds(page) {
    await stateOf(page, "speed", /^[1-9]/);
    await set(page, "window", "0.5");
    const [, currents, voltages] = await panesOf(page);
    const chips = () => currents.$$eval(".chip", (all) => all.map((each) => each.textContent));
    await kind(currents, "xy");
    const [size, ofXy] = [await currents.$eval("canvas", (canvas) => canvas.clientHeight), await chips()];
    await press(page, "Pause");
    await page.focus(".panes");
    const inkOf = () => currents.$eval("canvas", (canvas) => canvas.toDataURL());
    const before = await inkOf();
    await page.keyboard.press("a");
    await page.keyboard.press("ArrowLeft");
    await until(async () => String((await inkOf()) !== before), /true/); // the dot of the cursor
    const file = await catchFiles(page);
    await press(page, "SVG");
    const svg = await file(/\.svg/);
    await page.keyboard.press("Escape");
    await kind(voltages, "spectrum");
    await page.evaluate(() => { window.offered = {}; });
    const peaks = await until(() => voltages.$eval(".peaks", (each) => each.textContent), / at /);
    const ends = await voltages.$$eval('[aria-label="highest frequency"] option', (all) => all.map((each) => each.textContent));
    await press(page, "SVG");
    const spectrum = await file(/frequency \[Hz\]/);
    await set(page, "axes of the spectrum", "xy", voltages);
    const field = await voltages.$('[aria-label="cursor of the spectrum, Hz"]');
    await field.type("60");
    const cursor = await until(() => voltages.$eval(".peaks", (each) => each.textContent), /^at 60/);
    const steps = await field.evaluate((each) => Number(each.step));
    await page.keyboard.press("ArrowUp");
    const above = await until(() => voltages.$eval(".peaks", (each) => each.textContent), /^at 6[01](?!\.00 )/);
    await page.evaluate(() => { window.offered = {}; });
    await press(page, "SVG");
    return { size, chips: ofXy, svg, peaks, ends, spectrum, cursor, steps, above, logarithmic: await file(/frequency \[Hz\]/) };
  },

  /** A fault of one tick, and a trigger on it. */
  async trigger(page) {
    const armed = await armOnFault(page);
    const answer = await injectForATick(page);
    const state = await text(page, '[aria-label="trigger state"]', /triggered/);
    await add((await panesOf(page))[0], "0:injected");
    const row = await until(async () => JSON.stringify(await measured(page, "injected") ?? {}), /"maximum":"[1-9]/);
    const file = await catchFiles(page);
    await press(page, "CSV");
    const csv = await file(/\.csv/);
    await page.evaluate(() => { window.offered = {}; });
    await press(page, "MCAP");
    return { armed, state, answer, row: JSON.parse(row), csv, mcap: (await file(/MCAP0/)).split("\n")[0] };
  },

  /** The same while the page hears nothing for so long that it loses samples. */
  async slowTrigger(page) {
    await add((await panesOf(page))[0], "0:injected");
    await armOnFault(page);
    await injectForATick(page);
    await page.evaluate(() => {
      for (const end = Date.now() + 15_000; Date.now() < end;);
    });
    const lost = await text(page, "#scope .note", /samples lost/);
    const state = await text(page, '[aria-label="trigger state"]', /triggered/);
    const file = await catchFiles(page);
    await press(page, "CSV");
    return { lost, state, csv: await file(/\.csv/) };
  },

  /** A band that a signal leaves for one tick, and a hold-off in which it does so again. */
  async band(page) {
    await stateOf(page, "tick", /[1-9]/);
    await set(page, "window", "0.05");
    await set(page, "trigger condition", "leaves");
    await set(page, "trigger signal", "0:injected");
    await set(page, "lower end of the band", "0");
    await set(page, "hold-off after a trigger", "1e6");
    const stateShown = '[aria-label="trigger state"]';
    await set(page, "upper end of the band", "-1");
    const invalid = await page.$eval('[aria-label="upper end of the band"]', (each) => each.ariaInvalid);
    await set(page, "upper end of the band", "0");
    await text(page, stateShown, /armed/);
    await page.evaluate((where) => {
      const place = document.querySelector(where);
      window.states = [place.textContent];
      new MutationObserver(() => window.states.push(place.textContent)).observe(place, { childList: true, characterData: true, subtree: true });
    }, stateShown);
    for (const [label, value] of [["fault", "open_phase"], ["value of the fault", "1"], ["ticks that the fault lasts; 0: until it is ended", "1"]]) {
      await set(page, label, value);
    }
    const inject = async () => {
      await page.$eval("#knobs .answer", (each) => { each.textContent = ""; });
      await press(page, "Inject");
      const tick = Number((await text(page, "#knobs .answer", /at tick \d+/)).match(/at tick (\d+)/)[1]);
      await stateOf(page, "tick", new RegExp("^\\d{4,}$"));
      await until(async () => String(Number(await stateOf(page, "tick", /\d/)) > tick + 600), /true/);
    };
    await inject();
    await text(page, stateShown, /hold-off/);
    await inject();
    const held = await page.evaluate(() => window.states);
    await set(page, "unit of the hold-off", "ticks");
    await set(page, "hold-off after a trigger", "0");
    await inject();
    const after = JSON.parse(await until(() => page.evaluate(() => JSON.stringify(window.states)), /(triggered.*){2}/));
    return { invalid, held, after };
  },

  /** An axis that the page drives trips. */
  async stateEntered(page) {
    await stateOf(page, "tick", /\d/);
    await set(page, "window", "0.05");
    await set(page, "trigger condition", "state");
    await page.evaluate(() => {
      const states = document.querySelector('[aria-label="state that is entered"]');
      states.value = [...states.options].find((each) => each.textContent === "servo: fault").value;
      states.dispatchEvent(new Event("change"));
    });
    await set(page, "trigger sweep", "single");
    await set(page, "part of the window before the trigger, percent", "50");
    await text(page, '[aria-label="trigger state"]', /armed/);
    const [pane] = await panesOf(page);
    await add(pane, "0:state");
    await set(page, "boost: amplitude at standstill, V (servo)", "40"); // far more than the amplifier's 6 A
    await press(page, "drive servo");
    const state = await text(page, '[aria-label="trigger state"]', /triggered/);
    const file = await catchFiles(page);
    await stateOf(page, "tick", /^\d{4,}$/);
    await press(page, "CSV");
    return { state, csv: await file(/\.csv/) };
  },

  /** Values out of range, words instead of numbers, and a value that is taken. */
  async knobs(page, name, tooMuch, good) {
    await stateOf(page, "tick", /[1-9]/);
    const tried = async (value) => {
      await page.$eval("#knobs .answer", (each) => { each.textContent = ""; });
      await set(page, name, value);
      await press(page, `set ${name}`);
      return text(page, "#knobs .answer");
    };
    const refused = await tried(tooMuch);
    const word = await tried("much");
    const done = await tried(good);
    const inForce = await until(() => page.evaluate((wanted) =>
      document.querySelector(`[aria-label="${wanted}"]`).closest("li").querySelector(".value").textContent, name), new RegExp(`^${good}$`));
    await press(page, "Take the lease");
    const owner = await stateOf(page, "controller", /this page/);
    await press(page, "Release the lease");
    return { refused, word, done, inForce, owner, released: await stateOf(page, "controller", /none/) };
  },

  /** Every knob beside another controller. */
  async beside(page, token) {
    await enter(page, token);
    const facts = await text(page, "#bench-facts", /role/);
    await stateOf(page, "tick", /\d/);
    const parameter = "machine.rotor_resistance_ohm";
    const fields = [["load torque, N*m", "0.25"], ["impulse, N*m*s", "0.01"], [parameter, "2.5"], ["fault", "bus_sag"],
      ["value of the fault", "0.5"], ["ticks that the fault lasts; 0: until it is ended", "7"]];
    for (const [label, value] of fields) await set(page, label, value);
    const answers = {};
    for (const knob of ["Set load", "Bump", `set ${parameter}`, "Inject", "Clear faults"]) {
      await page.$eval("#knobs .answer", (each) => { each.textContent = ""; });
      await press(page, knob);
      answers[knob] = await text(page, "#knobs .answer");
    }
    return { facts, answers };
  },

  /** A user without rights, who first shows no token. */
  async viewer(page, token) {
    const asked = await enter(page, token);
    const facts = await text(page, "#bench-facts", /role/);
    return { asked, facts, knobs: await isShown(page, "#knobs"), buttons: await page.$$eval("#knobs button", (all) => all.length) };
  },

  /** The server ends and comes back. */
  async lost(page) {
    await text(page, "#link-state", /connected/);
    await outside("stop");
    const link = await text(page, "#link-state", /lost/);
    const alert = await text(page, "#alert");
    await outside("start");
    const again = await text(page, "#link-state", /connected/);
    return { link, alert, again, tick: await stateOf(page, "tick", /[1-9]/), alertShown: await isShown(page, "#alert") };
  },

  /** Keys alone: everything can be reached, and the plots obey. */
  async keyboard(page) {
    await stateOf(page, "tick", /[1-9]/);
    await press(page, "Pause"); // a page that does not draw answers sooner
    const reached = new Set(["Pause"]);
    for (let i = 0; i < 200; ++i) {
      await page.keyboard.press("Tab");
      const name = await page.evaluate(() => document.activeElement === document.body ? "" : document.activeElement.ariaLabel
        ?? document.activeElement.textContent);
      if (name === "") break;
      reached.add(name);
    }
    await page.focus(".panes");
    await page.keyboard.press("Space");
    await page.keyboard.press("Space");
    const paused = await page.evaluate(() => [...document.querySelectorAll("button")].some((each) => each.textContent === "Run"));
    for (const key of ["a", "ArrowLeft", "ArrowLeft", "b", "ArrowRight"]) await page.keyboard.press(key);
    const caption = await text(page, ".measurements caption", /Between/);
    const missing = await page.evaluate(() => [...document.querySelectorAll("button, input, select")]
      .filter((each) => !each.disabled && each.checkVisibility() && each.tabIndex < 0).map((each) => each.outerHTML));
    return { reached: [...reached], paused, caption, missing };
  },

  /** Every kind of pane, for axe-core. */
  async axe(page) {
    await stateOf(page, "tick", /[1-9]/);
    const [, locus, spectrum] = await panesOf(page);
    await kind(locus, "xy");
    await kind(spectrum, "spectrum");
    return axeFinds(page);
  },

  /** How soon the page shows the bench, and how often the panes are drawn anew, beside the frames that an empty page gets. */
  async frames(page, windowS, seconds) {
    await stateOf(page, "speed", /^[1-9]/);
    await page.setCacheEnabled(false);
    const opened = Date.now();
    await page.reload({ waitUntil: "domcontentloaded" });
    await stateOf(page, "speed", /^[1-9]/);
    const openS = (Date.now() - opened) / 1000;
    await set(page, "window", windowS);
    const [first] = await panesOf(page);
    await add(first, "0:torque_nm");
    await page.evaluate(() => {
      window.drawn = 0;
      const clear = CanvasRenderingContext2D.prototype.clearRect;
      CanvasRenderingContext2D.prototype.clearRect = function clearRect(...where) {
        if (this.canvas === document.querySelector(".pane canvas")) ++window.drawn;
        clear.apply(this, where);
      };
    });
    const pause = (length) => new Promise((done) => setTimeout(done, length * 1000));
    await pause(Number(windowS) + 2); // the window is full
    const lost = () => page.$eval(".note", (each) => Number.parseInt(each.textContent || "0", 10));
    const lostBefore = await lost();
    await outside("begin");
    const [before, start] = [await page.evaluate(() => window.drawn), Date.now()];
    await pause(Number(seconds));
    const drawn = (await page.evaluate(() => window.drawn)) - before;
    const tookS = (Date.now() - start) / 1000;
    await outside("end");
    const result = { openS, perSecond: drawn / tookS, lost: (await lost()) - lostBefore, signals: (await page.$$("#scope .chip")).length };
    await page.goto("about:blank");
    const floor = await page.evaluate(() => new Promise((done) => {
      let count = 0;
      const end = performance.now() + 3000;
      const frame = (now) => {
        if (now > end) return done(count / 3);
        ++count;
        requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }));
    return { ...result, floor };
  },

  /** A picture of the page in a theme. */
  async picture(page, theme, path) {
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: theme }]);
    await stateOf(page, "speed", /^[1-9]/);
    await set(page, "window", "0.2");
    const [, , voltages] = await panesOf(page);
    await kind(voltages, "spectrum");
    await press(page, "Add pane");
    const locus = (await panesOf(page))[3];
    await kind(locus, "xy");
    for (const signal of ["0:i_a_a", "0:i_b_a"]) await add(locus, signal);
    await until(async () => JSON.stringify(await measured(page, "speed_rad_s") ?? {}), /"maximum":"[1-9]/);
    await new Promise((done) => setTimeout(done, 1000));
    await page.screenshot({ path });
    return {};
  },
};

const [name, url, ...rest] = process.argv.slice(2);
const browser = await puppeteer.launch({
  executablePath: "/usr/bin/chromium", headless: true,
  args: ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--ignore-certificate-errors"],
});
try {
  const page = await browser.newPage();
  await page.setViewport({ width: 1440, height: 1080 });
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  await page.goto(url, { waitUntil: "domcontentloaded", timeout: kPatienceMs });
  const shown = await scenarios[name](page, ...rest);
  console.log(JSON.stringify({ ...shown, complaints }));
} finally {
  await browser.close();
}
process.exit(0);
