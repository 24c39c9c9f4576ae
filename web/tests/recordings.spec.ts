// A recording is made, listed, replayed as a plot and downloaded.
import { expect, open, test } from './bench';

test('a recording is made, its gap is named, it is drawn, finer after a zoom, and downloaded', async ({ bench, live }) => {
  const header = live.locator('.top').getByRole('group', { name: 'Recording' });
  await header.getByRole('button', { name: '● Record' }).click();
  await expect(header).toContainText(/REC \d\d:0[2-9]/, { timeout: 60_000 });
  await expect(header).not.toContainText('without values');
  bench.drives.process.kill('SIGSTOP');
  await expect(header).toContainText(/! .*st0\/1, st0\/2.*: [3-9][.\d]* s without values/, { timeout: 60_000 });
  bench.drives.process.kill('SIGCONT');
  await open(live, 'Recordings');
  // The gap stays named after the lines are back.
  const facts = live.getByRole('region', { name: 'The recording that is made' });
  await expect(facts).toContainText(/last second [1-9]/, { timeout: 60_000 });
  await expect(header).toContainText('s without values');
  await header.getByRole('button', { name: 'End recording' }).click();
  await expect(header.getByRole('button', { name: '● Record' })).toBeEnabled({ timeout: 30_000 });

  const item = live.getByRole('listitem').filter({ hasText: '.mcap' });
  await expect(item).toHaveCount(1);
  await expect(item).toContainText('whole');
  await expect(item).toContainText('st0/motor1');
  await expect(item).toContainText(/st0\/1, st0\/2.*s without values/);
  const parts: URL[] = [];
  live.on('response', (response) => {
    if (response.url().includes('/part?')) parts.push(new URL(response.url()));
  });
  await item.getByRole('heading').getByRole('link').click();
  const plot = live.getByRole('application');
  await expect(plot).toBeVisible();
  await expect.poll(() => parts.length).toBe(1);
  await expect(live.getByRole('row', { name: /st0\/motor1\/BUS_VOLTAGE/ })).toContainText(/\d\d/);
  await plot.focus();
  for (let times = 0; times < 8; times += 1) await live.keyboard.press('+');
  await expect.poll(() => parts.length).toBeGreaterThan(1);
  const [from, to] = ['from', 'to'].map((name) => Number(parts.at(-1)!.searchParams.get(name)));
  expect(to! - from!).toBeLessThan(3);

  const [download] = await Promise.all([
    live.waitForEvent('download'),
    live.getByRole('link', { name: 'Download' }).click(),
  ]);
  expect(await download.failure()).toBeNull();
  expect(download.suggestedFilename()).toMatch(/^\d{4}-\d\d-\d\dT\d\d-\d\d-\d\dZ\.mcap$/);
});
