// A motor that a page turned stops when the page is gone.
import type { Page } from '@playwright/test';
import { Chromium } from './chromium';
import { card, hold, spin, test } from './bench';

test('the motor of a real tab stops when the tab is away, hangs, is frozen or killed', async ({ bench }) => {
  const chromium = await Chromium.open();
  const opened = async () => {
    const page = await chromium.tab();
    await page.goto(bench.url);
    return page;
  };
  /** `event` stops the motor that the page turns. */
  const stops = async (what: string, page: Page, event: () => unknown) => {
    await spin(page, 1000, 'rmd0/1');
    await bench.turns('rmd', what);
    await event();
    await bench.rests('rmd', what);
  };
  try {
    let page = await opened();
    await stops('hidden', page, () => chromium.tab());
    await page.bringToFront();
    let hang: Promise<void> | undefined;
    await stops('hanging', page, () => {
      hang = page.evaluate(() => {
        const end = performance.now() + 3000;
        while (performance.now() < end);
      });
    });
    await hang;
    await stops('reloaded', page, () => page.reload());
    await stops('closed', page, () => page.close());
    page = await opened();
    await stops('frozen', page, async () => (await chromium.signals('SIGSTOP'))());
    (await chromium.signals('SIGCONT'))();
    await stops('killed', page, async () => (await chromium.signals('SIGKILL'))());
  } finally {
    await chromium.close();
  }
});

test('hold-to-run: motion needs the held button', async ({ bench, live: page }) => {
  const motor = card(page, 'st0/1');
  await motor.getByRole('switch', { name: 'Hold to run' }).check();
  await motor.getByRole('spinbutton', { name: 'Target, rpm' }).fill('1000');
  const button = motor.getByRole('button', { name: 'Hold to run' });
  await button.hover();
  await hold(motor, () => page.mouse.down(), () => page.mouse.up());
  await bench.turns();
  await page.mouse.up();
  await bench.rests();
  await button.focus();
  await hold(motor, () => page.keyboard.down('Enter'), () => page.keyboard.up('Enter'));
  await bench.turns();
  await page.keyboard.up('Enter');
  await bench.rests();
});
