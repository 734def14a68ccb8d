/** Scenarios with experiments and with what is played. */
export function experimentScenarios({ axeFinds, catchFiles, enter, isShown, pictureOf, press, set, stateOf, text, until }) {
  const answer = (page, pattern) => text(page, "#experiments .answer", pattern);
  const facts = (page) => page.$$eval("#player dt", (all) => Object.fromEntries(all.map((each) => [each.textContent, each.nextElementSibling.textContent])));

  /** The newest experiment of the list, by its heads. */
  const newest = (page) => page.evaluate(() => {
    const heads = [...document.querySelectorAll(".list thead tr > *")].map((each) => each.textContent);
    const cells = [...document.querySelectorAll(".list tbody tr:first-child > *")];
    return Object.fromEntries(cells.slice(0, -1).map((cell, i) => [heads[i], cell.textContent]));
  });

  /** What the player measures of a signal. */
  const measured = (page, signal) => page.evaluate((wanted) => {
    const row = [...document.querySelectorAll("#player .measurements tbody tr")].find((each) => each.querySelector("th").textContent === wanted);
    const heads = [...document.querySelectorAll("#player .measurements thead th")].map((each) => each.textContent);
    return row && Object.fromEntries([...row.children].map((cell, i) => [heads[i], cell.textContent]));
  }, signal);

  async function fill(page, values) {
    await until(() => page.$eval("#experiments details", (each) => String(!each.hidden)), /true/); // once the bench has told its list
    await page.$eval("#experiments details", (each) => { each.open = true; });
    for (const [label, value] of Object.entries(values)) await set(page, label, value);
  }

  async function queue(page, values) {
    await page.$eval("#experiments .answer", (each) => { each.textContent = ""; });
    await fill(page, values);
    await press(page, "Queue the experiment");
    return answer(page, /./);
  }

  const kSpin = { "title of the experiment": "spin", "length of the experiment, s": "0.5", "amplitude, V (shape 1)": "30", "frequency, Hz (shape 1)": "20" };
  const position = (page, pattern) => text(page, '[aria-label="time of the player"]', pattern);
  const pause = (ms) => new Promise((done) => setTimeout(done, ms));

  return {
    /** Asks for an experiment, by keys from the title on, looks at its data and saves them. */
    async experiment(page) {
      await stateOf(page, "tick", /\d/);
      const wrong = await queue(page, { ...kSpin, "length of the experiment, s": "long" });
      const refused = await queue(page, { ...kSpin, "length of the experiment, s": "1e9" });
      await fill(page, kSpin);
      await page.focus('[aria-label="title of the experiment"]');
      await page.keyboard.press("Enter");
      const done = await answer(page, /completed/);
      const title = await text(page, "#player h2");
      const row = JSON.parse(await until(async () => JSON.stringify(await measured(page, "speed_rad_s") ?? {}), /"maximum":"[1-9]/));
      const file = await catchFiles(page);
      await press(page, "save experiment-1.csv");
      const csv = (await file(/experiment-1\.csv/)).split("\n");
      return { wrong, refused, done, title, row, list: await newest(page), facts: await facts(page), csv: [...csv.slice(0, 3), csv[2002]], rows: csv.length - 3 };
    },

    /** Other parameters than those of the bench, an event and a limit. */
    async limited(page) {
      await stateOf(page, "tick", /\d/);
      await fill(page, kSpin);
      await press(page, "Add parameter");
      await set(page, "parameter 1", "mechanics.inertia_kgm2");
      await set(page, "value of parameter 1", "0.001");
      await press(page, "Add event");
      await set(page, "event 1", "bump");
      await set(page, "time of event 1, s", "0.3");
      await set(page, "value of event 1", "0.03");
      await queue(page, { "stop above this speed, rad/s; 0: no limit": "45" });
      await answer(page, /stopped/);
      return { list: await newest(page), facts: await facts(page) };
    },

    /** A recording: the slider, play, pause, speed. */
    async played(page) {
      await stateOf(page, "tick", /\d/);
      await queue(page, kSpin);
      await answer(page, /completed/);
      await press(page, "Play recording experiment 1");
      const title = await text(page, "#player h2", /recording/);
      await answer(page, /completed/);
      const atEnd = await text(page, "#player .train .speed");
      await page.focus('[aria-label="tick of the player"]');
      await page.keyboard.press("Home");
      const start = await position(page, /^0\.0000 s/);
      const atStart = await text(page, "#player .train .speed");
      const empty = JSON.parse(await until(async () => JSON.stringify(await measured(page, "speed_rad_s") ?? {}), /"maximum":"0/));
      await page.keyboard.press("ArrowRight");
      const next = await position(page, /^0\.0001 s/);
      await set(page, "speed of the player", "0.01");
      await page.focus("#player .panes");
      await page.keyboard.press("Space");
      const playing = await position(page, /^0\.[012]\d{3} s/);
      const rotor = () => page.$eval("#player .train .rotor", (each) => each.getAttribute("transform"));
      const angles = new Set();
      for (let i = 0; i < 10; ++i) {
        angles.add(await rotor());
        await pause(60);
      }
      await press(page, "Pause the player");
      const stood = await position(page);
      await pause(500);
      const stands = await position(page);
      await set(page, "speed of the player", "10");
      await press(page, "Play");
      const over = await position(page, /^0\.500[01] s/);
      const newestSpeed = (await until(async () => (await measured(page, "speed_rad_s"))?.newest, /^4/));
      await press(page, "close the player");
      return { title, atEnd, start, atStart, empty, next, playing, angles: angles.size, stood, stands, over, newestSpeed, shown: await isShown(page, "#player") };
    },

    /** An experiment of the second axis: its recording has both. */
    async second(page) {
      await stateOf(page, "tick", /\d/);
      await set(page, "axis of the experiment", "1");
      await queue(page, { "length of the experiment, s": "0.1" });
      await answer(page, /completed/);
      const data = await page.$$eval("#player .chip", (all) => all.map((each) => each.textContent));
      await press(page, "Play recording experiment 1");
      await text(page, "#player h2", /recording/);
      const recording = await page.$$eval("#player .chip", (all) => all.map((each) => each.textContent));
      return { data, recording, trains: (await page.$$("#player .train")).length, identify: (await facts(page)).identify };
    },

    /** A long experiment is given up. */
    async cancelled(page) {
      await stateOf(page, "tick", /\d/);
      await queue(page, { ...kSpin, "length of the experiment, s": "100", "pace of the experiment": "1" });
      const progress = await until(() => page.evaluate(() => String(document.querySelector(".list progress")?.value ?? 0)), /[1-9]/);
      const running = await newest(page);
      await press(page, "Cancel experiment 1");
      await answer(page, /experiment 1: cancelled/);
      return { progress: Number(progress), running, list: await newest(page), title: await text(page, "#player h2") };
    },

    /** Who may not change anything sees what is there, and the data that its owner shares. */
    async lookers(page, token) {
      await enter(page, token);
      await text(page, "#experiments tbody", /long/);
      const titles = await page.$$eval(".list tbody tr", (all) => all.map((each) => each.children[1].textContent));
      const buttons = await page.$$eval("#experiments button", (all) => all.filter((each) => each.checkVisibility()).map((each) => each.ariaLabel ?? each.textContent));
      await press(page, "Show data experiment 1");
      await answer(page, /completed/);
      return { titles, buttons, title: await text(page, "#player h2"), form: await page.$$eval("#experiments .experiment", (all) => all.length) };
    },

    /** Recordings of the user's own computer. */
    async files(page, good, bad) {
      await stateOf(page, "tick", /\d/);
      const open = async (path) => {
        const [field] = await page.$$('[aria-label="recording to play"]');
        await field.uploadFile(path);
        return answer(page, new RegExp(path.split("/").pop().replaceAll(".", "\\.")));
      };
      const opened = await open(good);
      const title = await text(page, "#player h2");
      const chips = await page.$$eval("#player .chip", (all) => all.map((each) => each.textContent));
      const row = JSON.parse(await until(async () => JSON.stringify(await measured(page, "speed_rad_s") ?? {}), /"maximum":"[1-9]/));
      return { opened, title, chips, row, time: await position(page), refused: await open(bad), still: await text(page, "#player h2") };
    },

    /** An experiment ends while its user looks at something else. */
    async undisturbed(page, path) {
      await stateOf(page, "tick", /\d/);
      const [field] = await page.$$('[aria-label="recording to play"]');
      await field.uploadFile(path);
      await answer(page, /is open/);
      await queue(page, kSpin);
      const told = await answer(page, /completed/);
      await pause(1000);
      return { told, title: await text(page, "#player h2"), progress: await isShown(page, '[aria-label="progress of the data"]') };
    },

    /** A recording that is opened again and again, and a drag in its plots. */
    async reopened(page, path) {
      await stateOf(page, "tick", /\d/);
      const canvases = async () => {
        await pause(300); // uPlot draws once more
        const handle = await page.evaluateHandle(() => HTMLCanvasElement.prototype);
        const all = await page.queryObjects(handle); // collects garbage first
        const count = await page.evaluate((each) => each.length, all);
        await Promise.all([all.dispose(), handle.dispose()]); // they hold what they name
        return count;
      };
      const open = async () => {
        await page.$eval("#experiments .answer", (each) => { each.textContent = ""; });
        const [field] = await page.$$('[aria-label="recording to play"]');
        await field.uploadFile(path);
        await answer(page, /is open/);
      };
      await open();
      const once = await canvases();
      for (let i = 0; i < 4; ++i) await open();
      const often = await canvases();
      const plot = await page.$("#player .u-over");
      await plot.scrollIntoView();
      const { x, y, width, height } = await plot.boundingBox();
      await page.mouse.move(x + 0.2 * width, y + height / 2);
      await page.mouse.down();
      await page.mouse.move(x + 0.6 * width, y + height / 2, { steps: 5 });
      await page.mouse.up();
      await pause(300);
      const live = await page.$eval("#scope .bar button", (each) => each.textContent);
      await press(page, "close the player");
      const closed = await canvases();
      await page.$eval('#scope [aria-label="remove this pane"]', (each) => each.click());
      return { once, often, live, closed, removed: await canvases() };
    },

    /** A picture of the form and of a recording that is played. */
    async experimentPicture(page, theme, path) {
      await stateOf(page, "tick", /\d/);
      await queue(page, { ...kSpin, "amplitude, V (shape 1)": "20" });
      await answer(page, /completed/);
      await press(page, "Play recording experiment 1");
      await text(page, "#player h2", /recording/);
      await answer(page, /completed/);
      await page.$eval('[aria-label="tick of the player"]', (field) => {
        field.value = "1600";
        field.dispatchEvent(new Event("input"));
      });
      await pictureOf(page, theme, path, "#experiments", "#player");
      return {};
    },

    /** A bench that keeps no experiments. */
    async none(page) {
      return { note: await text(page, "#experiments .table p"), form: await isShown(page, "#experiments details") };
    },

    /** The open form and the player, for axe-core and the keys. */
    async experimentAxe(page) {
      await stateOf(page, "tick", /\d/);
      await fill(page, kSpin);
      for (const words of ["Add parameter", "Add event", "Add shape"]) await press(page, words);
      await set(page, "time of event 1, s", "0.1");
      await press(page, "remove shape 2");
      const focus = await page.evaluate(() => document.activeElement.textContent);
      await press(page, "Queue the experiment");
      await answer(page, /completed|stopped/);
      const missing = await page.evaluate(() => [...document.querySelectorAll("button, input, select, summary")]
        .filter((each) => !each.disabled && each.checkVisibility() && each.tabIndex < 0).map((each) => each.outerHTML));
      return { ...(await axeFinds(page)), missing, focus, live: await page.$eval("#player output", (each) => each.getAttribute("aria-live")) };
    },
  };
}
