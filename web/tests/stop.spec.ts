// Stop all: from every view, by button and by key, with and without the WebSocket.
import { card, expect, open, spin, test, VIEWS } from './bench';

/** A motor that turns, faster than what it does at rest. */
const TURNS = 300;
const STILL = 5;

test.describe('stop all', () => {
  test('from every view, by button and by key', async ({ bench, live }) => {
    test.setTimeout(240_000);
    for (const view of VIEWS) {
      for (const way of ['button', 'Escape', 'Space']) {
        await open(live, 'Motors');
        await spin(live, 1000);
        await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
        await open(live, view);
        if (way === 'button') await live.getByRole('button', { name: /STOP ALL/i }).click();
        else await live.keyboard.press(way);
        await expect(live.getByText(/Stopped: \d+ of \d+ motors confirmed/), `${view}, ${way}`).toBeVisible();
        await expect.poll(() => bench.speed('st', 1), { message: `${view}, ${way}` }).toBeLessThan(STILL);
        await live.getByRole('button', { name: 'Release' }).click();
      }
    }
  });

  test('refuses motion until it is released', async ({ bench, live }) => {
    await live.keyboard.press('Escape');
    await expect(live.getByRole('button', { name: 'Release' })).toBeVisible();
    const motor = card(live, 'st0/1');
    await motor.getByRole('spinbutton', { name: 'Target, rpm' }).fill('500');
    await motor.getByRole('button', { name: 'Run to target' }).click();
    await expect(motor.getByText(/latch/i)).toBeVisible();
    expect(await bench.speed('st', 1)).toBeLessThan(STILL);
    await live.getByRole('button', { name: 'Release' }).click();
    await spin(live, 500);
    await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
  });

  test('goes by HTTP while the WebSocket is down', async ({ bench, page }) => {
    let isDown = false;
    await page.routeWebSocket(/\/ws$/, (socket) => {
      const server = socket.connectToServer();
      socket.onMessage((message) => {
        if (!isDown) server.send(message);
      });
      server.onMessage((message) => {
        if (!isDown) socket.send(message);
      });
    });
    await page.goto(bench.url);
    // Started by another program: no dead-man of this page stops it.
    await bench.start();
    await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
    isDown = true;
    await page.keyboard.press('Escape');
    await expect(page.getByText(/Stopped: \d+ of \d+ motors confirmed/)).toBeVisible();
    await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
  });

  test('says so if it cannot reach the server', async ({ bench, live }) => {
    await bench.monitor.end('SIGKILL');
    await live.keyboard.press('Escape');
    await expect(live.getByText(/Not reachable/)).toBeVisible();
    await expect(live.getByText(/guard/)).toBeVisible();
  });
});
