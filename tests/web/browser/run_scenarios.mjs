/** Scenarios of a user who lets the gateway run suites and identifications. */
export function runScenarios({ axeFinds, enter, pictureOf, press, set, stateOf, text, until }) {
  const kRuns = '[aria-label="List of runs"] tbody tr';
  const row = (page, number) => page.$$eval(kRuns, (all, wanted) =>
    all.map((each) => [...each.children].slice(0, -1).map((cell) => cell.textContent)).find((cells) => cells[0] === wanted), String(number));
  const rowWhen = async (page, number, pattern) => JSON.parse(await until(async () => JSON.stringify(await row(page, number) ?? []), pattern));
  const focused = (page) => page.evaluate(() => document.activeElement.ariaLabel ?? document.activeElement.textContent);

  /** By keys alone. */
  async function runSuite(page, name) {
    await page.focus('[aria-label="suite to run"]');
    await page.keyboard.type(name);
    await page.keyboard.press("Tab");
    await page.keyboard.press("Enter");
  }

  /** Of the experiment whose data the secret opens; its row in the list of runs. */
  async function identify(page, owner, run) {
    await set(page, "secret that opens the data", owner);
    await press(page, "Use the secret");
    await text(page, "#experiments .list tbody", /voltage steps/);
    await until(() => page.$eval('[aria-label="Identify experiment 1"]', (each) => String(!each.hidden)), /true/);
    await press(page, "Identify experiment 1");
    const ended = await rowWhen(page, run, /passed|failed/);
    await text(page, "#reports caption", /experiment-1-dc/);
    await page.waitForFunction(() => document.querySelector("#reports img")?.complete);
    return ended;
  }

  return {
    async runs(page, owner) {
      await stateOf(page, "tick", /\d/);
      await text(page, '[aria-label="suite to run"]', /servo/);
      const suites = await page.$$eval('[aria-label="suite to run"] option', (all) => all.map((each) => each.value));
      await runSuite(page, "servo");
      const suite = await rowWhen(page, 1, /passed/);
      await runSuite(page, "lasting");
      const running = (await rowWhen(page, 2, /runs.*0 of 1/))[3];
      await page.focus('[aria-label="suite to run"]');
      const reached = [await focused(page)];
      while (reached.length < 3) {
        await page.keyboard.press("Tab");
        reached.push(await focused(page));
      }
      await press(page, "Cancel run 2");
      const cancelled = (await rowWhen(page, 2, /cancelled|passed|failed/))[2];
      const identification = await identify(page, owner, 3);
      return {
        suites, suite, running, reached, cancelled, identification,
        rows: await page.$$eval("#reports caption", ([caption]) => [...caption.parentElement.querySelectorAll("tbody tr")].map((each) =>
          [...each.children].map((cell) => cell.textContent))),
        text: await text(page, "#reports"), plot: await page.$eval("#reports img", (each) => each.naturalWidth),
        answer: await text(page, "#reports div > .answer", /run 3: [^d]/),
        names: await page.$$eval('[aria-label="List of reports"] tbody th', (all) => all.map((each) => each.textContent)), ...await axeFinds(page),
      };
    },

    async runsPicture(page, theme, path, owner) {
      await stateOf(page, "tick", /\d/);
      await text(page, '[aria-label="suite to run"]', /servo/);
      await runSuite(page, "servo");
      await rowWhen(page, 1, /passed/);
      await identify(page, owner, 2);
      await pictureOf(page, theme, path, "#reports", "#reports");
      return {};
    },

    /** What a viewer can press among the runs and the experiments. */
    async runsSeen(page, token) {
      await enter(page, token);
      await stateOf(page, "tick", /\d/);
      const seen = await rowWhen(page, 1, /passed|failed/);
      const controls = await page.$$eval("#reports button, #reports select, #experiments button", (all) => all.filter((each) => each.checkVisibility())
        .map((each) => each.ariaLabel ?? each.textContent).filter((each) => /Run|Cancel|Identify|suite/.test(each)));
      return { row: seen, controls };
    },
  };
}
