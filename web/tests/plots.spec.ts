// Plots of simulated drives.
import type { Page } from '@playwright/test';
import { readFileSync } from 'node:fs';
import { expect, open, spin, test } from './bench';

/** Chooses signals by their names. */
async function choose(page: Page, ...names: string[]) {
  await open(page, 'Plots');
  await page.getByText(/^Signals \(\d+\)$/).click();
  await page.getByRole('button', { name: 'Remove all' }).click();
  await page.getByLabel('Values a second').first().selectOption('100');
  for (const name of names) {
    await page.getByRole('searchbox', { name: 'Search' }).fill(name);
    await page.getByRole('list', { name: 'Signals that can be read' }).getByLabel(name).first().check();
  }
}

/** A cell of a curve beside the plot. */
const cell = (page: Page, curve: string, column: string) =>
  page.getByRole('row').filter({ hasText: curve }).locator(`td[data-name="${column}"] [data-is]`).first();

const numberIn = async (page: Page, curve: string, column: string) =>
  Number((await cell(page, curve, column).textContent())!.replace('−', '-'));

test.describe.configure({ timeout: 180_000 });

const SPEED = 'st0/1 SPEED_MEAS';
const RMD = 'rmd0/1 speed_dps';

test('shows what turns, also while it is paused, and says when values are old', async ({ bench, live }) => {
  await choose(live, SPEED, RMD);
  await expect.poll(() => numberIn(live, SPEED, 'Now')).toBe(0);
  await open(live, 'Motors');
  await spin(live, 1000);
  await open(live, 'Plots');
  await expect.poll(() => numberIn(live, SPEED, 'Max')).toBeGreaterThan(300);
  await live.getByRole('button', { name: 'Pause' }).click();
  await expect(live.getByText(/Paused, \d+ s behind/)).toBeVisible();
  await live.keyboard.press('Escape');
  await expect.poll(() => numberIn(live, SPEED, 'Now')).toBeLessThan(50);
  // Values of before the pause are confirmed, and come, a moment after it.
  const max = await numberIn(live, SPEED, 'Max');
  expect(max).toBeGreaterThan(300);
  const behind = async () => Number(/(\d+) s behind/.exec((await live.getByText(/Paused/).textContent())!)![1]);
  const then = await behind();
  await expect.poll(behind).toBeGreaterThan(then + 1);
  expect(await numberIn(live, SPEED, 'Max')).toBe(max);
  await live.getByRole('button', { name: 'Back to live' }).click();
  await expect(live.getByText('Live', { exact: true })).toBeVisible();
  expect(await numberIn(live, SPEED, 'Max')).toBeGreaterThanOrEqual(max);

  bench.monitor.process.kill('SIGSTOP');
  await expect(live.locator('.plot-old [data-is="old"]').first()).toHaveText(/[23] s old/);
  bench.monitor.process.kill('SIGCONT');
  await expect(live.locator('.plot-old')).toHaveCount(0);
});

test('begins with the speeds of the motors, has room for curves, and remembers another choice', async ({ live }) => {
  await open(live, 'Plots');
  await expect(live.getByText('Signals (6)')).toBeVisible();
  await expect.poll(() => numberIn(live, SPEED, 'Now')).toBe(0);
  await expect.poll(() => numberIn(live, RMD, 'Max')).toBe(0);
  // The table of curves is beside or below them.
  for (const [width, most] of [[390, 374], [1280, 440]] as const) {
    await live.setViewportSize({ width, height: 800 });
    const legend = live.getByRole('region', { name: 'Curves of Signals' });
    expect((await legend.boundingBox())!.width).toBeLessThanOrEqual(most);
    // Nothing is cut off.
    expect(await legend.evaluate(({ scrollWidth, clientWidth }) => scrollWidth - clientWidth)).toBe(0);
  }
  await live.getByText('Signals (6)').click();
  await live.getByRole('button', { name: `Remove ${SPEED}` }).click();
  await live.reload();
  await expect(live.getByText('Signals (5)')).toBeVisible();
});

test('cursors by keys and by mouse: values, difference, the wire; and what is visible as CSV', async ({ live }) => {
  await choose(live, SPEED, RMD);
  await expect.poll(() => numberIn(live, SPEED, 'Now')).toBe(0);
  await expect.poll(() => numberIn(live, RMD, 'Now')).toBe(0);
  await live.getByRole('button', { name: 'Pause' }).click();
  const [download] = await Promise.all([
    live.waitForEvent('download'),
    live.getByRole('button', { name: 'Export CSV' }).click(),
  ]);
  const [header, ...rows] = readFileSync(await download.path(), 'utf8').split('\r\n');
  expect(header).toBe(`time,line,line_seconds,${SPEED} (rpm),${RMD} (°/s)`);
  expect(rows.length).toBeGreaterThan(5);
  expect(rows[0]).toMatch(/^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z,(st0|rmd0),\d+\.\d{6},/);

  // Motors at rest: their curves are a line in the middle, at the right.
  const { x, y, width, height } = (await live.locator('.plot .u-over').boundingBox())!;
  await live.mouse.click(x + width - 8, y + height / 2);
  const reading = live.locator('.plot-reading');
  await expect(reading).toHaveText(/^A\s/);
  await live.keyboard.down('Shift');
  await live.mouse.click(x + width / 2, y + height / 3);
  await live.keyboard.up('Shift');
  await expect(reading).toHaveText(/B\s/);
  // A click on a curve stays in the view, and Shift selects no text.
  expect(await live.evaluate(() => String(getSelection()))).toBe('');
  await expect(live).toHaveURL(/#\/plots$/);
  await live.getByRole('button', { name: 'Show the wire at A' }).click();
  await expect(live).toHaveURL(/#\/wire\?line=(st0|rmd0)&t=\d+\.\d+/);

  await open(live, 'Plots');
  await live.getByRole('application', { name: 'Signals' }).focus();
  // Cursors begin in the middle of the plot, where there are no values yet. The end is live.
  const keys = ['Delete', 'Home', 'ArrowRight', ',', ',', '.', 'Shift+ArrowRight', 'Shift+ArrowRight'];
  for (const key of keys) await live.keyboard.press(key);
  await expect(reading).toHaveText(/A\s.*B\s.*B\s−\sA\s.*1\/\(B\s−\sA\)\s.*Hz/);
  await expect(live.locator('.plot [aria-live]')).toHaveText(/st0\/1 SPEED_MEAS/);
  await live.keyboard.press('Enter');
  await expect(live).toHaveURL(/#\/wire\?line=st0&t=\d+\.\d+/);
});
