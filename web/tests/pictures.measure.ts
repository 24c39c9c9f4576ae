// The pictures of docs/MONITOR.md and README.md: `make pictures`.
import { chromium, test, type Page } from '@playwright/test';
import { Bench, card, open, spin } from './bench';
import { ARGUMENTS, PROGRAM } from './chromium';

const DOCS = '../docs';
const DESK = { width: 1280, height: 800 };
const PHONE = { width: 390, height: 844 };

/** Turns an RMD motor, so that the picture has both protocols. */
async function turn(page: Page) {
  const motor = card(page, 'rmd0/1');
  await motor.getByRole('spinbutton', { name: 'Target, °/s' }).fill('360');
  await motor.getByRole('button', { name: 'Run to target' }).click();
}

test('pictures', async () => {
  test.setTimeout(300_000);
  const bench = new Bench();
  const browser = await chromium.launch({ executablePath: PROGRAM, args: ARGUMENTS });
  try {
    await bench.plug();
    await bench.serve();
    for (const colorScheme of ['dark', 'light'] as const) {
      const suffix = colorScheme === 'dark' ? '' : '-light';
      for (const [size, viewport] of [['', DESK], ['-phone', PHONE]] as const) {
        const context = await browser.newContext({ viewport, colorScheme });
        const page = await context.newPage();
        await page.goto(bench.url);
        if (size === '' && colorScheme === 'dark') {
          await open(page, 'Plots');
          await page.getByText('Signals (6)').click();
          await page.getByRole('button', { name: 'Remove all' }).click();
          for (const name of ['SPEED_MEAS', 'TORQUE_MEAS']) {
            await page.getByRole('searchbox', { name: 'Search' }).fill(`st0/1 ${name}`);
            await page.getByRole('checkbox', { name: `st0/1 ${name}` }).check();
          }
          await page.getByText('Signals (2)').click();
          await open(page, 'Motors');
        }
        await spin(page, 1500);
        await turn(page);
        // The ramps are over, and the trends are full.
        await page.waitForTimeout(10_000);
        await page.mouse.move(0, 0);
        await page.evaluate(() => scrollTo(0, 0));
        await page.screenshot({ path: `${DOCS}/monitor${size}${suffix}.png` });
        if (size === '' && colorScheme === 'dark') {
          for (const view of ['Plots', 'Registers', 'Wire'] as const) {
            await open(page, view);
            await page.waitForTimeout(5000);
            await page.screenshot({ path: `${DOCS}/monitor-${view.toLowerCase()}.png` });
          }
        }
        await context.close();
      }
    }
  } finally {
    await browser.close();
    await bench.end();
  }
});
