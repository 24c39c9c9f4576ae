// Stop all: from every view, by button and by key, with and without the WebSocket.
import { card, expect, open, Program, spin, STILL, test, TURNS, VIEWS } from './bench';

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

  test('of one motor ends what its card says of the motion, and so does a lost connection', async ({ bench, live }) => {
    const motor = card(live, 'st0/1');
    const running = motor.getByText(/^✓ Running/);
    await spin(live, 1000);
    await expect(motor.getByText(/^✓ Running to 1000 rpm\. The ramp took/)).toBeVisible();
    await motor.getByRole('button', { name: 'Stop', exact: true }).click();
    await expect(motor.getByText('Stopped: the motor confirmed it.')).toBeVisible();
    await expect(running).toHaveCount(0);
    await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
    await spin(live, 1000);
    await expect(motor.getByText('live', { exact: true })).toBeVisible();
    await bench.monitor.end('SIGKILL');
    await expect(live.getByText('Connection lost')).toBeVisible();
    await expect(running).toHaveCount(0);
    await expect(motor.getByText('live', { exact: true })).toHaveCount(0);
  });

  test('goes by HTTP while the WebSocket is down', async ({ bench, page }) => {
    // In the page: Playwright's route of a WebSocket is too slow for the samples.
    await page.addInitScript(() => {
      window.WebSocket = class extends WebSocket {
        override send(data: string) {
          if (!('isDown' in window)) super.send(data);
        }
        override set onmessage(hear: (event: MessageEvent) => void) {
          this.addEventListener('message', (event) => 'isDown' in window || hear(event));
        }
      };
    });
    await page.goto(bench.url);
    // Started by another program: no dead-man of this page stops it.
    await bench.start();
    await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
    await page.evaluate(() => Object.assign(window, { isDown: true }));
    await page.keyboard.press('Escape');
    await expect(page.getByText(/Stopped: \d+ of \d+ motors confirmed/)).toBeVisible();
    await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
  });

  for (const [width, height] of [[390, 844], [1280, 800]] as const) {
    test(`leaves room if many motors did not confirm, ${width} pixels`, async ({ bench, page }) => {
      await page.setViewportSize({ width, height });
      await page.route('**/api/stop-all', (route) => route.abort());
      const failure = 'no drive confirmed it: the drive did not reply within 50 ms, and then not within 1 s';
      const motors = Array.from({ length: 30 }, (_, at) => ({ line: 'rmd9', motor: at + 1, failure }));
      await page.addInitScript((motors) => {
        window.WebSocket = class extends WebSocket {
          override set onmessage(hear: (event: MessageEvent) => void) {
            this.addEventListener('message', ({ data }: MessageEvent<unknown>) => {
              const isAnswer = typeof data === 'string' && data.includes('"to":"stop-all"');
              const heard = isAnswer ? JSON.stringify({ ...(JSON.parse(data) as object), motors }) : data;
              hear(new MessageEvent('message', { data: heard }));
            });
          }
        };
      }, motors);
      await page.goto(bench.url);
      await expect(page.getByRole('article')).toHaveCount(6);
      await page.keyboard.press('Escape');
      await expect(page.getByText(/rmd9\/3 and 27 more did not confirm: they may still be turning/)).toBeVisible();
      await page.getByText('What each said').click();
      await expect(page.getByText(`rmd9/30: ${failure}`)).toBeAttached();
      await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
      const release = (await page.getByRole('button', { name: 'Release' }).boundingBox())!;
      expect(release.y + release.height).toBeLessThan(0.6 * height);
      for (const name of [/STOP ALL/, 'Release', /^Close/]) {
        await expect(page.getByRole('button', { name })).toBeInViewport({ ratio: 1 });
      }
      await page.getByRole('button', { name: /^Close/ }).click();
      await expect(page.getByText(/did not confirm/)).toHaveCount(0);
      await page.getByRole('button', { name: 'Release' }).click();
      await expect(page.getByRole('button', { name: 'Release' })).toHaveCount(0);
    });
  }

  test('that was not confirmed is named on every page, also on one that is opened later', async ({ bench, live, browser }) => {
    test.setTimeout(120_000);
    const context = await browser.newContext();
    try {
      const viewer = await context.newPage();
      await viewer.goto(bench.viewerUrl);
      await expect(viewer.getByRole('article')).toHaveCount(6);
      bench.drives.process.kill('SIGSTOP');
      await live.keyboard.press('Escape');
      await expect(live.getByText(/not yet: rmd0\/1, rmd0\/2, rmd0\/3 and 3 more/)).toBeVisible();
      // The stop by HTTP is one of the monitor.
      const latch = viewer.getByRole('region', { name: 'Latch' });
      const named = /Stop of all by (page \d+|monitor)\. Not confirmed, may be turning: rmd0\/1, rmd0\/2, rmd0\/3 and 3 more\./;
      await expect(latch.getByText(named)).toBeVisible();
      // No search finds the motors now.
      await viewer.reload();
      await expect(latch.getByText(named)).toBeVisible();
      await expect(viewer.getByRole('article')).toHaveCount(6);
      await expect(card(viewer, 'st0/1').getByText('✕ silent')).toBeVisible();
      await expect(live.getByText(/did not confirm: they may still be turning/)).toBeVisible({ timeout: 60_000 });
      await open(live, 'Ports');
      await expect(live.getByRole('article', { name: 'Line st0' }).getByText('no motor answers')).toBeVisible();
      bench.drives.process.kill('SIGCONT');
      await expect(live.getByText('Stopped: 6 of 6 motors confirmed.')).toBeVisible({ timeout: 30_000 });
      await expect(latch.getByText(/^Stopped by (page \d+|monitor)\.$/)).toBeVisible();
    } finally {
      bench.drives.process.kill('SIGCONT');
      await context.close();
    }
  });

  test('is not needed if the monitor of another share is killed, and the page says so', async ({ bench, page }) => {
    await bench.monitor.end();
    const at = `unix:${bench.folder}/share`;
    const share = new Program(['share', '-p', `${bench.folder}/st0`, '--timeout', '1s', '--at', at, '--json'], bench.folder);
    try {
      await share.line(({ event }) => event === 'ready');
      await bench.serve(['--share', at]);
      await page.goto(bench.url);
      await spin(page, 1000);
      await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
      await bench.monitor.end('SIGKILL');
      await expect(page.getByText(/the share, which is another process, has stopped the motors of this page/)).toBeVisible();
      await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
    } finally {
      await share.end();
    }
  });

  test('says so if it cannot reach the server', async ({ bench, live }) => {
    await bench.monitor.end('SIGKILL');
    await live.keyboard.press('Escape');
    await expect(live.getByText(/Not reachable/)).toBeVisible();
    await expect(live.getByText(/guard/).first()).toBeVisible();
  });
});
