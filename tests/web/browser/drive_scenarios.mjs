/** Scenarios of an operator who drives an axis. */
export function driveScenarios({ axeFinds, enter, outside, pictureOf, press, set, stateOf, text, until }) {
  const answer = (page, pattern) => text(page, "#drive .answer", pattern);
  const now = (page, pattern) => text(page, "#drive .value", pattern);
  const tickOf = async (page) => Number(await stateOf(page, "tick", /^\d+$/));

  /** The tick at which the time stands: the page may show some ticks before it. */
  async function standingTick(page) {
    await until(async () => {
      const first = await tickOf(page);
      await new Promise((done) => setTimeout(done, 1200));
      return String((await tickOf(page)) - first);
    }, /^0$/);
    return tickOf(page);
  }

  /** Fills in a V/f start. */
  async function fill(page, values) {
    await stateOf(page, "tick", /\d/);
    for (const [label, value] of Object.entries(values)) await set(page, `${label} (servo)`, value);
  }

  const kStart = { "target frequency, Hz": "20", "amplitude at the target, V": "30", "boost: amplitude at standstill, V": "10", "ramp, s": "0.5" };

  /** Drives until the motor has this speed; once more where a busy machine keeps the page silent for so long that the gateway gives up. */
  async function turning(page, speed) {
    for (;;) {
      await press(page, "drive servo");
      await answer(page, /drives it|silent/);
      const shown = () => stateOf(page, "speed");
      const seen = await until(async () => (/silent/.test(await answer(page)) ? "silent" : shown()), new RegExp(`silent|${speed.source}`));
      if (seen !== "silent") return seen;
      await stateOf(page, "controller", /none/);
    }
  }

  return {
    /** Lockstep: drive, turn a knob, hold the time, make steps, stop and give back; keys alone from the fields on. */
    async drive(page, token) {
      await enter(page, token);
      await fill(page, kStart);
      const before = await text(page, "#state .notes", /stands still/);
      await page.focus('[aria-label="drive servo"]');
      await page.keyboard.press("Enter");
      const owner = await stateOf(page, "controller", /this page/);
      const arrived = await now(page, /^20\.00 Hz/);
      const speed = await stateOf(page, "speed", /^4[12]\.\d* rad/);
      await set(page, "impulse, N*m*s", "0.0001");
      await press(page, "Bump");
      const bump = await text(page, "#knobs .answer", /:/);
      await press(page, "Release the lease");
      const kept = await text(page, "#knobs .answer", /lease/);
      await press(page, "Hold the time");
      const held = await standingTick(page);
      await set(page, "ticks of a step", "7");
      await press(page, "Step");
      await stateOf(page, "tick", new RegExp(`^(?!${held}$)\\d+$`));
      const steps = (await standingTick(page)) - held;
      await press(page, "Let the time run");
      await page.focus(".panes");
      await page.keyboard.press("Escape");
      const stopped = await answer(page, /stopped/);
      const off = await now(page, /off/);
      await stateOf(page, "speed", /^[0-2]?\d\.\d* rad/); // it coasts
      await outside("stopped");
      await press(page, "give servo back");
      const given = await answer(page, /given back/);
      const isStopShown = () => page.$eval("#stop", (each) => String(!each.hidden));
      await until(isStopShown, /false/);
      return { before, owner, arrived, speed, bump, kept, steps, stopped, off, given, free: await stateOf(page, "controller", /none/) };
    },

    /** Real time: the page goes while the motor turns. */
    async gone(page) {
      await fill(page, kStart);
      const speed = await turning(page, /^4[12]\.\d* rad/);
      await now(page, /^20\.00 Hz/);
      await outside("turning");
      await page.goto("about:blank");
      await outside("gone");
      return { speed };
    },

    /** The reference controllers that the page offers, and the run of one. */
    async preset(page, axis, name) {
      await stateOf(page, "tick", /\d/);
      await page.waitForSelector(`[aria-label="preset of ${axis}"]`);
      const offered = await page.$$eval(`[aria-label="preset of ${axis}"] option`, (all) => all.map((each) => each.value));
      await set(page, `preset of ${axis}`, name);
      const source = await text(page, ".preset .soft");
      await press(page, `run the preset on ${axis}`);
      const words = await text(page, '.preset [role="status"]', /done|did not/);
      const numbers = await page.$$eval(".preset tbody tr", (all) => all.map((row) => [...row.children].map((each) => each.textContent)));
      const owner = await stateOf(page, "controller", /this page/);
      const { found } = await axeFinds(page);
      await press(page, `give ${axis} back`);
      return { offered, source, words, numbers, owner, found, free: await stateOf(page, "controller", /none/) };
    },

    /** A run that is stopped, one that is refused, and a page that goes in the middle of one. */
    async presetStopped(page, axis, name, other) {
      await stateOf(page, "tick", /\d/);
      await page.waitForSelector(`[aria-label="preset of ${axis}"]`);
      const words = (pattern) => text(page, '.preset [role="status"]', pattern);
      await set(page, `preset of ${axis}`, name);
      await press(page, `run the preset on ${axis}`);
      await words(/moving/);
      await outside("running");
      await page.focus(".panes");
      await page.keyboard.press("Escape");
      const stopped = [await answer(page, /stopped/), await words(/stopped/)];
      await outside("stopped");
      await page.$eval(`[aria-label="preset of ${axis}"]`, (field, wanted) => {
        field.append(new Option(wanted, wanted));
        field.value = wanted;
      }, other);
      await press(page, `run the preset on ${axis}`);
      const refused = await answer(page, /does not fit/);
      await set(page, `preset of ${axis}`, name);
      await press(page, `run the preset on ${axis}`);
      await words(/moving/);
      await page.goto("about:blank");
      await outside("gone");
      return { stopped, refused };
    },

    /** What the page may not do, and fields that are no numbers. */
    async refused(page) {
      await fill(page, { ...kStart, "ramp, s": "-1" });
      await press(page, "drive servo");
      const ramp = await answer(page, /ramp/);
      await set(page, "ramp, s (servo)", "0.5");
      await outside("take the lease");
      await press(page, "drive servo");
      const owned = await answer(page, /lease:/);
      await outside("free the lease");
      await set(page, "amplitude at the target, V (servo)", "1e9");
      await press(page, "drive servo");
      const beyond = await answer(page, /1e9/);
      return { ramp, owned, beyond };
    },

    /** Two motors on one amplifier: a lease of one is that of both. */
    async shared(page, token) {
      await enter(page, token);
      await stateOf(page, "tick", /\d/);
      const answers = {};
      const load = async (name) => {
        await page.$eval("#knobs .answer", (each) => { each.textContent = ""; });
        await page.evaluate(() => [...document.querySelectorAll("#knobs details")][1].querySelector("form button").click());
        answers[name] = await text(page, "#knobs .answer", /:/);
      };
      const controllers = () => page.$$eval("#state dt", (all) => all.filter((each) => each.textContent === "controller").map((each) => each.nextElementSibling.textContent).join());
      const buttons = () => page.$$eval("#knobs button", (all) => all.map((each) => each.textContent).filter((each) => each.endsWith("the lease")));
      await load("borrowed");
      // Both motors stay below the trip of their amplifier, however long they turn.
      const gentle = { ...kStart, "amplitude at the target, V": "1", "boost: amplitude at standstill, V": "1" };
      for (const [label, value] of Object.entries(gentle)) await set(page, `${label} (first)`, value);
      await press(page, "drive first");
      const driven = await until(controllers, /this page,this page/);
      const held = await buttons();
      await load("driven");
      await page.keyboard.press("Escape");
      await answer(page, /stopped/);
      await press(page, "give first back");
      await answer(page, /given back/);
      await page.evaluate(() => [...document.querySelectorAll("#knobs details")][1].querySelector("button").click());
      const taken = await until(controllers, /this page,this page/);
      return { answers, driven, held, taken };
    },

    /** A picture of the state and of the drive while the motor turns. */
    async drivePicture(page, theme, path) {
      await fill(page, { ...kStart, "amplitude at the target, V": "12", "boost: amplitude at standstill, V": "4", "ramp, s": "2" });
      await press(page, "drive servo");
      await now(page, /^20\.00 Hz/);
      await stateOf(page, "speed", /^4[012]\.\d* rad/);
      await pictureOf(page, theme, path, "#state", "#drive");
      return {};
    },

    /** For axe-core: while the page drives, with each wave and unit once. */
    async driveAxe(page) {
      await fill(page, kStart);
      await press(page, "drive servo");
      await now(page, /Hz/);
      const fields = {};
      for (const wave of ["rotating", "standing", "terminals"]) {
        for (const gates of ["voltage", "duty"]) {
          await set(page, "wave of servo", wave);
          await set(page, "set-points of servo", gates);
          fields[`${wave} ${gates}`] = await page.$$eval("#drive .fields input", (all) => all.map((each) => `${each.ariaLabel}=${each.value}`));
        }
      }
      const tabbed = await page.evaluate(() => [...document.querySelectorAll("#drive button, #drive input, #drive select, #stop")]
        .filter((each) => !each.disabled && (!each.checkVisibility() || each.tabIndex < 0)).map((each) => each.outerHTML));
      return { ...(await axeFinds(page)), fields, tabbed };
    },
  };
}
