// A motor that a page turned stops when the page is gone.
import type { Page } from '@playwright/test';
import { Chromium } from './chromium';
import { card, expect, hold, spin, STILL, test, TURNS } from './bench';
import { Network } from './network';

interface World {
  chromium: Chromium;
  network: Network;
  page: Page;
}

/** A real tab with a motor that it turned. */
const turning = test.extend<{ world: World }>({
  world: async ({ bench }, use) => {
    const network = await Network.open();
    const chromium = await Chromium.open({ proxy: network.proxy });
    try {
      const page = await chromium.tab();
      await page.goto(bench.url);
      await spin(page, 1000);
      await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
      await use({ chromium, network, page });
    } finally {
      await chromium.close();
      await network.close();
    }
  },
});

turning('its process is killed', async ({ bench, world }) => {
  (await world.chromium.signals('SIGKILL'))();
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
});

turning('its process is frozen', async ({ bench, world }) => {
  (await world.chromium.signals('SIGSTOP'))();
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
});

turning('its tab is hidden, and it may turn motors again later', async ({ bench, world }) => {
  await world.chromium.tab();
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
  await world.page.bringToFront();
  await spin(world.page, 800);
  await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
});

turning('its tab is closed', async ({ bench, world }) => {
  await world.page.close();
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
});

turning('it is reloaded', async ({ bench, world }) => {
  await world.page.reload();
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
});

turning('its main thread hangs', async ({ bench, world }) => {
  const hang = world.page.evaluate(() => {
    const end = performance.now() + 3000;
    while (performance.now() < end);
  });
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
  await hang;
});

for (const cut of ['both', 'to-server', 'to-browser'] as const) {
  turning(`the network is cut (${cut})`, async ({ bench, world }) => {
    world.network.set({ cut });
    await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
    if (cut !== 'to-server') {
      // What the page shows is marked as old.
      await expect(card(world.page, 'st0/1').getByText(/\d+ s old/).first()).toBeVisible();
    }
    world.network.set({});
    await expect(world.page.getByText(/Connected/)).toBeVisible();
    expect(await bench.speed('st', 1)).toBeLessThan(STILL);
  });
}

turning('the network is slower than the deadline', async ({ bench, world }) => {
  world.network.set({ delay: 1200 });
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
});

turning('a viewer that leaves stops nothing', async ({ bench, world }) => {
  await expect(async () => {
    const viewer = await world.chromium.tab();
    await viewer.goto(bench.viewerUrl);
    await world.page.bringToFront();
    await spin(world.page, 1000);
    await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
    await viewer.close();
    await expect(world.page.getByText(/Connected/)).toBeVisible();
    await new Promise((done) => setTimeout(done, 1000));
    // On a busy machine the page may have been late, so that its motor stopped: then once more.
    expect(await bench.speed('st', 1)).toBeGreaterThan(TURNS);
  }).toPass();
});

turning('hold-to-run: motion needs the held button', async ({ bench, world: { page } }) => {
  const motor = card(page, 'st0/1');
  await motor.getByRole('button', { name: 'Stop', exact: true }).click();
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
  await motor.getByRole('switch', { name: 'Hold to run' }).check();
  await motor.getByRole('spinbutton', { name: 'Target, rpm' }).fill('1000');
  const button = motor.getByRole('button', { name: 'Hold to run' });
  await button.hover();
  await hold(motor, () => page.mouse.down(), () => page.mouse.up());
  await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
  await page.mouse.up();
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
  await button.focus();
  await hold(motor, () => page.keyboard.down('Enter'), () => page.keyboard.up('Enter'));
  await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
  await page.keyboard.up('Enter');
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
});
