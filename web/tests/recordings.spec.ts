// A recording is made, listed, replayed as a plot and downloaded.
import type { Page } from '@playwright/test';
import { expect, open, test } from './bench';

const inHeader = (page: Page) => page.locator('.top').getByRole('group', { name: 'Recording' });

test('a recording is made, seen by all pages, drawn with more points after a zoom, and downloaded', async ({
  bench, live, browser,
}) => {
  test.setTimeout(120_000);
  const header = inHeader(live);
  await header.getByRole('button', { name: '● Record' }).click();
  await expect(header).toContainText(/REC \d\d:0[2-9]/, { timeout: 60_000 });
  // Another page sees it, and it goes on without the first one.
  const context = await browser.newContext();
  const other = await context.newPage();
  await other.goto(bench.url);
  await live.close();
  await expect(inHeader(other)).toContainText(/REC \d\d:0[5-9]/, { timeout: 60_000 });
  await inHeader(other).getByRole('button', { name: 'End recording' }).click();
  await expect(inHeader(other).getByRole('button', { name: '● Record' })).toBeEnabled({ timeout: 30_000 });

  await open(other, 'Recordings');
  const item = other.getByRole('listitem').filter({ hasText: '.mcap' });
  await expect(item).toHaveCount(1);
  await expect(item).toContainText('whole');
  await expect(item).toContainText('st0/motor1');
  const parts: URL[] = [];
  other.on('response', (response) => {
    if (response.url().includes('/part?')) parts.push(new URL(response.url()));
  });
  await item.getByRole('heading').getByRole('link').click();
  const plot = other.getByRole('application');
  await expect(plot).toBeVisible();
  await expect.poll(() => parts.length).toBe(1);
  const row = other.getByRole('row', { name: /st0\/motor1\/BUS_VOLTAGE/ });
  await expect(row).toContainText(/\d\d/);
  await plot.focus();
  for (let times = 0; times < 8; times += 1) await other.keyboard.press('+');
  await expect.poll(() => parts.length).toBeGreaterThan(1);
  const [from, to] = ['from', 'to'].map((name) => Number(parts.at(-1)!.searchParams.get(name)));
  expect(to! - from!).toBeLessThan(3);

  const [download] = await Promise.all([
    other.waitForEvent('download'),
    other.getByRole('link', { name: 'Download' }).click(),
  ]);
  expect(await download.failure()).toBeNull();
  expect(download.suggestedFilename()).toMatch(/^\d{4}-\d\d-\d\dT\d\d-\d\d-\d\dZ\.mcap$/);
  await context.close();
});

test('motors without values for a time are named in the header and in the list', async ({ bench, live }) => {
  test.setTimeout(120_000);
  const header = inHeader(live);
  await header.getByRole('button', { name: '● Record' }).click();
  await expect(header).toContainText(/REC \d\d:0[2-9]/, { timeout: 60_000 });
  await expect(header).not.toContainText('without values');
  await bench.drives.end('SIGKILL');
  await expect(header).toContainText(/! .*st0\/1, st0\/2.*: [3-9][.\d]* s without values/, { timeout: 60_000 });
  await bench.plug();
  await open(live, 'Recordings');
  const facts = live.getByRole('region', { name: 'The recording that is made' });
  // The gap stays named after the lines are back.
  await expect(facts).toContainText(/last second (9\d|100)\.\d Hz/, { timeout: 60_000 });
  await expect(facts).toContainText(/lowest mean \d\d\.\d of 100\.0 Hz \((st0|rmd0)\/\d\)/);
  await expect(header).toContainText('s without values');
  await header.getByRole('button', { name: 'End recording' }).click();
  await expect(live.getByRole('listitem').filter({ hasText: '.mcap' })).toContainText(/st0\/1, st0\/2.*s without values/);
});
