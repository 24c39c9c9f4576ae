// Every view, in both colour schemes, at the width of a desk and of a phone (the projects of the config).
import AxeBuilder from '@axe-core/playwright';
import { expect, open, test, VIEWS } from './bench';

for (const colorScheme of ['light', 'dark'] as const) {
  test.describe(colorScheme, () => {
    test.use({ colorScheme });

    test('every view is accessible, and as wide as the window', async ({ live }) => {
      test.setTimeout(120_000);
      for (const view of VIEWS) {
        await open(live, view);
        const { violations } = await new AxeBuilder({ page: live }).analyze();
        expect(violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(' ')}`), view).toEqual([]);
        const [wide, width] = await live.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
        expect(wide, `${view} scrolls sideways`).toBeLessThanOrEqual(width!);
        const stop = await live.getByRole('button', { name: /STOP ALL/i }).boundingBox();
        expect(stop!.height, view).toBeGreaterThanOrEqual(48);
        expect(stop!.y + stop!.height, view).toBeLessThan(live.viewportSize()!.height / 2);
      }
    });
  });
}

test('no request leaves the machine, and nothing is refused by the policy', async ({ bench, page }) => {
  const urls: string[] = [];
  const complaints: string[] = [];
  page.on('request', (request) => urls.push(request.url()));
  page.on('console', (message) => {
    if (message.type() === 'error' || message.type() === 'warning') complaints.push(message.text());
  });
  page.on('pageerror', (error) => complaints.push(error.message));
  await page.goto(bench.url);
  for (const view of VIEWS) await open(page, view);
  const { host } = new URL(bench.url);
  expect(urls.filter((url) => new URL(url).host !== host)).toEqual([]);
  expect(complaints).toEqual([]);
});

test('the token is not in the address, and the page needs the cookie', async ({ bench, live, browser }) => {
  expect(live.url()).not.toContain('token');
  const stranger = await browser.newContext();
  const response = await (await stranger.newPage()).goto(new URL('/', bench.url).href);
  expect(response!.status()).toBe(401);
  await stranger.close();
});
