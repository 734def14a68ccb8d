/** Scenarios of a user who reads reports. */
export function reportScenarios({ axeFinds, press, text }) {
  const rows = (page) => page.$$eval("#reports div:last-child tbody tr", (all) => all.map((row) => [...row.children].map((each) => each.textContent)));
  const names = (page) => page.$$eval("#reports .list tbody th", (all) => all.map((each) => each.textContent));
  const answer = (page, pattern) => text(page, "#reports > .answer", pattern);

  /** A report in a tab of its own. */
  async function opened(page, name) {
    const url = await page.$eval(`[aria-label="open ${name}"]`, (each) => each.href);
    const tab = await page.browser().newPage();
    await tab.goto(url);
    return tab;
  }

  return {
    async reports(page) {
      await text(page, "#reports .list tbody th");
      await press(page, "show motor.json");
      await text(page, "#reports caption", /motor\.json/);
      await page.waitForFunction(() => document.querySelector("#reports img")?.complete);
      const plot = await page.$eval("#reports img", (each) => each.naturalWidth);
      const shown = { names: await names(page), rows: await rows(page), text: await text(page, "#reports"), plot, ...await axeFinds(page) };
      const tab = await opened(page, "suite.html");
      return { ...shown, title: await tab.title(), cells: (await tab.$$("td")).length, font: await tab.$eval("body", (each) => getComputedStyle(each).fontFamily) };
    },

    async hostileReports(page) {
      await text(page, "#reports .list tbody th");
      await press(page, "show shape.json");
      const shape = await answer(page, /shape/);
      await press(page, "show broken.json");
      const broken = await answer(page, /broken/);
      await press(page, "show hostile.json");
      await text(page, "#reports caption", /hostile/);
      const [row] = await rows(page);
      const images = await page.$$eval("#reports img", (all) => all.map((each) => each.alt));
      const tab = await opened(page, "hostile.html");
      const facts = { title: await tab.title(), origin: await tab.evaluate(() => self.origin) };
      const drawing = await opened(page, "hostile.svg");
      return { ...facts, svg: await drawing.title(), shape, broken, row, images, pageTitle: await page.title() };
    },
  };
}
