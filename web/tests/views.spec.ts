// Every view, at the widths and in the colour schemes of the projects of the config.
import { expect, open, test, VIEWS, violations } from './bench';

test('every view is accessible, as wide as the window, and asks nobody but its server @look', async ({ bench, page }) => {
  const urls: string[] = [];
  const complaints: string[] = [];
  page.on('request', (request) => urls.push(request.url()));
  page.on('console', (message) => {
    if (message.type() === 'error' || message.type() === 'warning') complaints.push(message.text());
  });
  page.on('pageerror', (error) => complaints.push(error.message));
  await page.goto(bench.url);
  await expect(page.getByRole('article')).toHaveCount(6);
  for (const view of VIEWS) {
    await open(page, view);
    if (view === 'Plots') {
      await page.getByLabel('Division into plots').selectOption('A plot for each unit');
      for (const table of await page.getByText('Values as a table').all()) await table.click();
      await expect(page.getByRole('table').nth(1).getByRole('row').nth(2)).toBeVisible();
    }
    expect(await violations(page), view).toEqual([]);
    const [wide, width] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
    expect(wide, `${view} scrolls sideways`).toBeLessThanOrEqual(width!);
    const stop = await page.getByRole('button', { name: /STOP ALL/i }).boundingBox();
    expect(stop!.height, view).toBeGreaterThanOrEqual(48);
    expect(stop!.y + stop!.height, view).toBeLessThan(page.viewportSize()!.height / 2);
  }
  const { host } = new URL(bench.url);
  expect(urls.filter((url) => new URL(url).host !== host)).toEqual([]);
  expect(complaints).toEqual([]);
});
