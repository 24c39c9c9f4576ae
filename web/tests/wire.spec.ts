// The frames of a line: live, searched, saved, and around an instant.
import { readFileSync } from 'node:fs';
import type { Page } from '@playwright/test';
import { expect, open, test } from './bench';

const region = (page: Page) => page.getByRole('region', { name: 'Frames' });
/** All rows, also those that are not in the document. */
const count = async (page: Page) => Number(await region(page).getByRole('table').getAttribute('aria-rowcount')) - 1;

test('frames come live, can be paused, searched and saved, and are shown around an instant', async ({ bench, live }) => {
  bench.read();
  await open(live, 'Wire');
  await expect.poll(() => count(live)).toBeGreaterThan(300);
  const rows = region(live).getByRole('row');
  expect(await rows.count()).toBeLessThan(120);
  // The newest frame is seen.
  const words = await rows.last().innerText();
  await expect.poll(async () => (await rows.last().innerText()) !== words).toBe(true);
  await expect(rows.last()).toBeInViewport();
  await expect(live.getByText(/^Live\. In .* % of the time waiting for replies/)).toBeVisible();

  await live.getByRole('button', { name: 'Pause' }).click();
  await expect(live.getByText(/^Paused\./)).toBeVisible();
  await expect(live.getByRole('button', { name: 'Continue' })).toBeVisible();
  const all = await count(live);
  await live.getByRole('combobox', { name: 'Direction' }).selectOption('from the drive');
  await expect.poll(() => count(live)).toBeLessThan(all);
  await expect(rows.filter({ hasText: '→ drive' })).toHaveCount(0);
  await live.getByRole('searchbox', { name: 'Search' }).fill('ack rpm');
  await expect(rows.nth(1)).toContainText('rpm');

  const download = live.waitForEvent('download');
  await live.getByRole('button', { name: 'Save as CSV' }).click();
  const file = readFileSync(await (await download).path(), 'utf8').trimEnd().split('\r\n');
  expect(file).toHaveLength(1 + (await count(live)));
  expect(file[0]).toMatch(/^t,direction,motor,/);
  expect(file.at(-1)).toMatch(/^\d+\.\d{6},from-drive,1?2?,ok,/);

  // The frames around an instant: the nearest is marked.
  await live.getByRole('searchbox', { name: 'Search' }).fill('');
  await live.getByRole('combobox', { name: 'Direction' }).selectOption({ index: 0 });
  const frames = region(live);
  await frames.focus();
  await live.keyboard.press('Home');
  for (let moved = 0; moved < 5; moved += 1) await live.keyboard.press('PageDown');
  const chosen = frames.locator('tr[aria-current]');
  const time = (await chosen.getByRole('cell').first().innerText()).trim().split(/\s+/).at(-1)!;
  await live.evaluate((t) => (location.hash = `#/wire?line=st0&t=${t}`), time);
  const marked = frames.getByRole('row').filter({ hasText: '▶' });
  await expect(marked).toContainText(time);
  await expect(marked).toBeInViewport();
  await expect(live.getByText(new RegExp(`^From 0\\.25 s before ${time} s`))).toBeVisible();
  await expect(live.getByRole('region', { name: 'Chosen frame' })).toContainText('nearest to the instant');
  expect(await count(live)).toBeGreaterThan(10);
  await live.getByRole('button', { name: 'Live' }).click();
  await expect(live.getByText(/^Live\./)).toBeVisible();

  // A phone shows the meaning of frames in rows of one height.
  await live.setViewportSize({ width: 390, height: 844 });
  await expect.poll(() => count(live)).toBeGreaterThan(100);
  const cut = await frames.evaluate((box) => {
    const words = [...box.querySelectorAll('td span')].find((one) => one.textContent === 'GET_REG SPEED_MEAS, motor 1')!;
    return words.scrollHeight - words.clientHeight;
  });
  expect(cut).toBeLessThanOrEqual(0);
  const heights = await frames.evaluate((box) =>
    [...box.querySelectorAll('tbody tr:not(.space)')].map((row) => Math.round(row.getBoundingClientRect().height)));
  expect(new Set(heights)).toEqual(new Set([44]));
});
