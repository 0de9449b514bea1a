// node page.mjs MODULES FOLDER: opens the pages of a folder in headless Chromium and checks what a reader meets: nothing
// is loaded or thrown, charts have their data, search, download, slider and 3D pane work, hostile names stay text, and axe
// (installed in the folder MODULES, with Playwright) finds nothing serious. `bake.html` is that of a scene with hostile
// names, whose report is `bake.json`; `rounds.html` has a slider of rounds, and `thesis.html` shows experiments of the lab.
// With PAGE_SHOTS=FOLDER, screenshots are written there.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, folder] = process.argv.slice(2);
const require = createRequire(path.resolve(modules, 'package.json'));
const { chromium } = require('playwright-core');
const axe = readFileSync(require.resolve('axe-core/axe.min.js'), 'utf8');
const shots = process.env.PAGE_SHOTS;

/// Opens a page, and collects what it must not do.
async function open(browser, name, { prepare, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 1440, height: 900 }, ...options });
  const page = await context.newPage();
  const faults = [];
  const address = pathToFileURL(path.resolve(folder, name)).href;
  page.on('console', (message) => message.type() === 'error' && faults.push(`console: ${message.text()}`));
  page.on('pageerror', (error) => faults.push(`thrown: ${error.message}`));
  page.on('dialog', (dialog) => {
    faults.push(`dialog: ${dialog.message()}`);
    dialog.dismiss();
  });
  page.on('request', (request) => {
    const url = request.url();
    if (url !== address && !url.startsWith('data:') && !url.startsWith('blob:')) faults.push(`request: ${url}`);
  });
  if (prepare) await page.addInitScript(prepare);
  await page.goto(address);
  return { page, faults, close: () => context.close() };
}

async function shoot(page, name) {
  if (shots) await page.screenshot({ path: path.join(shots, `${name}.png`), fullPage: true });
}

async function checkAccessible(page, what) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ['violations'] }));
  const serious = violations.filter(({ impact }) => impact === 'serious' || impact === 'critical');
  const said = serious.map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.slice(0, 3).map((n) => n.html).join(' ')}`);
  assert.deepEqual(said, [], `${what}: axe`);
}

async function checkCharts(page, expected) {
  const charts = await page.$$eval('figure.chart', (figures) =>
    figures.map((figure) => ({
      title: figure.querySelector('h3').textContent,
      marks: figure.querySelectorAll('svg rect, svg circle').length,
      named: document.getElementById(figure.querySelector('svg').getAttribute('aria-labelledby')) !== null,
      rows: figure.querySelectorAll('table tbody tr').length,
      cells: new Set([...figure.querySelectorAll('tr')].map((row) => row.children.length)).size,
    })),
  );
  assert.equal(charts.length, expected, JSON.stringify(charts));
  for (const { title, marks, named, rows, cells } of charts) {
    assert.ok(marks > 0 && named && rows > 0 && cells === 1, `${title}: ${marks} marks, ${rows} rows`);
  }
}

async function checkDownload(page) {
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#download')]);
  assert.match(download.suggestedFilename(), /\.bake\.json$/);
  const report = JSON.parse(readFileSync(path.join(folder, 'bake.json'), 'utf8'));
  assert.deepEqual(JSON.parse(readFileSync(await download.path(), 'utf8')), report);
}

async function checkSearch(page) {
  assert.match(await page.textContent('#found'), /can be found here/);
  await page.fill('#search', 'ALERT');
  const lines = await page.$$eval('#found li', (found) => found.map((line) => line.textContent));
  assert.ok(lines.length >= 2 && lines.some((line) => line.includes('<img src=x onerror=alert(1)>')), lines.join('\n'));
  await page.fill('#search', 'no such name');
  assert.match(await page.textContent('#found'), /0 objects and 0 groups found/);
}

async function checkNames(page) {
  const text = await page.textContent('body');
  for (const shown of ['⟨U+202E⟩', '⟨U+0007⟩', '</script>', '…']) assert.ok(text.includes(shown), `${shown} is shown`);
  assert.ok(!/[\u202a-\u202e\u2066-\u2069\u0007]/.test(text), 'no mark of direction is left');
  assert.equal(await page.$$eval('img[src="x"], svg[onload]', (injected) => injected.length), 0);
  assert.equal(await page.evaluate(() => globalThis.hacked), undefined);
  const longest = await page.$$eval('body *', (all) =>
    Math.max(...all.filter((e) => e.children.length === 0 && !['SCRIPT', 'STYLE', 'PRE'].includes(e.tagName)).map((e) => e.textContent.length)),
  );
  assert.ok(longest < 1000, `a text of ${longest} characters`);
}

/// The picture on the canvas of the pane.
const drawn = (page) => page.$eval('#pane canvas', (canvas) => canvas.toDataURL());

async function checkPane(page) {
  const first = await drawn(page);
  assert.ok(first.length > 5000, 'something is drawn');
  await page.check('input[name="side"][value="before"]');
  assert.notEqual(await drawn(page), first, 'before differs from after');
  await page.check('input[name="side"][value="after"]');
  assert.equal(await drawn(page), first, 'after is shown again');
  await page.focus('#pane canvas');
  await page.keyboard.press('n');
  assert.match(await page.textContent('#pane-group'), /triangles?, placed/);
  await page.keyboard.press('Escape');
  assert.match(await page.textContent('#pane-group'), /Click a box/);
  await page.keyboard.press('ArrowRight');
  assert.notEqual(await drawn(page), first, 'it turns');
  await page.click('#pane-reset');
  const box = await page.locator('#pane canvas').boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  assert.match(await page.textContent('#pane-group'), /It holds triangles of \d+ objects?/);
  await page.uncheck('#pane-surface');
  await page.uncheck('#pane-boxes');
  const empty = await drawn(page);
  assert.ok(empty.length < first.length, 'nothing is drawn');
  await page.check('#pane-surface');
  await page.check('#pane-boxes');
}

async function checkSliders(page) {
  const views = await page.$$eval('input[name="picture"]', (radios) => radios.map((radio) => radio.value));
  assert.deepEqual(views, ['shaded', 'groups', 'heatmap', 'overlap']);
  for (const view of views) {
    await page.check(`input[name="picture"][value="${view}"]`);
    const shown = await page.$$eval('.picture', (all) => all.filter((one) => one.checkVisibility()).map((one) => one.id));
    assert.deepEqual(shown, [`picture-${view}`]);
    const after = page.locator(`#picture-${view} img.after`);
    const clip = () => after.evaluate((image) => getComputedStyle(image).clipPath);
    assert.ok(await after.evaluate((image) => image.complete && image.naturalWidth > 0), `${view} is a picture`);
    await page.focus(`#picture-${view} input`);
    await page.keyboard.press('Home');
    assert.equal(await clip(), 'inset(0px 0px 0px 0%)');
    await page.keyboard.press('End');
    assert.equal(await clip(), 'inset(0px 0px 0px 100%)');
    await page.locator(`#picture-${view} input`).fill('50');
  }
  await page.check('input[name="picture"][value="shaded"]');
}

async function checkTheme(page) {
  const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  assert.equal(await ground(), 'rgb(255, 255, 255)');
  await page.click('#theme');
  assert.notEqual(await ground(), 'rgb(255, 255, 255)');
  await checkAccessible(page, 'dark by the button');
  await page.click('#theme');
  assert.equal(await ground(), 'rgb(255, 255, 255)');
}

async function checkNarrow(page, name) {
  await page.setViewportSize({ width: 375, height: 812 });
  const width = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(width <= 375, `${name} is ${width} pixels wide on a phone`);
  await checkAccessible(page, `${name} on a phone`);
  await shoot(page, `${name}-375`);
}

async function checkBake(browser) {
  const { page, faults, close } = await open(browser, 'bake.html', { colorScheme: 'light' });
  await checkCharts(page, 7);
  await checkNames(page);
  await checkSearch(page);
  await checkPane(page);
  await checkSliders(page);
  await checkDownload(page);
  await checkAccessible(page, 'bake');
  await shoot(page, 'bake-1440');
  await checkTheme(page);
  await checkNarrow(page, 'bake');
  await page.emulateMedia({ media: 'print' });
  assert.equal(await page.locator('.top').isVisible(), false);
  assert.deepEqual(faults, []);
  await close();
}

async function checkOther(browser, name, charts) {
  const { page, faults, close } = await open(browser, `${name}.html`, { colorScheme: 'dark' });
  await checkCharts(page, charts);
  assert.ok((await drawn(page)).length > 5000, `${name}: something is drawn`);
  await checkAccessible(page, `${name} in the dark`);
  await shoot(page, `${name}-dark-1440`);
  await checkNarrow(page, `${name}-dark`);
  assert.deepEqual(faults, []);
  await close();
}

async function checkRounds(browser) {
  const { page, faults, close } = await open(browser, 'rounds.html', { colorScheme: 'light' });
  const said = () => page.textContent('#of-round');
  const last = await page.$eval('#round', (slider) => slider.max);
  assert.ok(last > 0 && (await said()).startsWith(`${last} of ${last}: `) && (await said()).endsWith('taken'));
  await page.fill('#round', '0');
  assert.match(await said(), /^0 of \d+: groups \d+, splits 0, merges 0, overlap ratio [\d.]+/);
  assert.equal(await page.getAttribute('.cursor', 'transform'), 'translate(0)');
  await checkAccessible(page, 'rounds');
  assert.deepEqual(faults, []);
  await close();
}

async function checkExperiments(browser) {
  const { page, faults, close } = await open(browser, 'thesis.html', { colorScheme: 'dark' });
  const pictures = await page.$$eval('img', (all) => all.map((one) => one.complete && one.naturalWidth > 0));
  assert.ok(pictures.length >= 6 && pictures.every((shown) => shown), `pictures: ${pictures}`);
  const words = await page.$$eval('figure svg text', (all) => all.map((one) => getComputedStyle(one).fill));
  assert.ok(words.length > 0 && words.every((fill) => fill === 'rgb(0, 0, 0)'), 'charts are dark on white');
  await checkAccessible(page, 'experiments in the dark');
  await checkNarrow(page, 'thesis-dark');
  const broken = await page.$$eval('table bdi', (all) => all.filter((one) => one.getClientRects().length > 4).map((one) => one.textContent));
  assert.deepEqual(broken, [], 'cells are wide enough');
  assert.deepEqual(faults, []);
  await close();
}

async function checkWithoutWebGl(browser) {
  const prepare = () => {
    HTMLCanvasElement.prototype.getContext = () => null;
  };
  const { page, faults, close } = await open(browser, 'inspect.html', { prepare });
  assert.match(await page.textContent('#pane'), /needs WebGL/);
  await page.fill('#search', 'a');
  assert.match(await page.textContent('#found'), /found/);
  // three.js reports that it got no context.
  assert.deepEqual(faults.filter((fault) => !fault.includes('WebGL')), []);
  await close();
}

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'],
});
try {
  await checkBake(browser);
  await checkOther(browser, 'verify', 4);
  await checkOther(browser, 'inspect', 3);
  await checkRounds(browser);
  await checkExperiments(browser);
  await checkWithoutWebGl(browser);
} finally {
  await browser.close();
}
