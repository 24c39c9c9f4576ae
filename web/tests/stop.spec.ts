// Stop all: from every view, by button and by key, with and without the WebSocket. The stop of one motor.
import { card, expect, open, spin, STILL, test, VIEWS } from './bench';

const CONFIRMED = /Stopped: \d+ of \d+ motors confirmed/;

test('a stop works from every view, by button and by key, and by HTTP while the WebSocket is down', async ({ bench, page }) => {
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
  await expect(page.getByRole('article')).toHaveCount(6);
  const button = page.getByRole('button', { name: /STOP ALL/i });
  const release = page.getByRole('button', { name: 'Release' });
  // Another program turns the motor: no dead-man of this page stops it.
  const start = bench.starter();
  const stops = async (what: string, press: () => Promise<void>) => {
    start();
    await bench.turns('rmd', what);
    await press();
    await expect(page.getByText(CONFIRMED), what).toBeVisible();
    await bench.rests('rmd', what);
  };
  for (const view of VIEWS) {
    await open(page, view);
    // A view with a field of text in focus would take the Space.
    for (const way of ['button', 'Space']) {
      await stops(`${view}, ${way}`, () => (way === 'button' ? button.click() : page.keyboard.press(way)));
      await release.click();
      await expect(release).toBeHidden();
    }
  }
  await stops('HTTP', async () => {
    await page.evaluate(() => Object.assign(window, { isDown: true }));
    await page.keyboard.press('Escape');
  });
});

test('a card says what is true of its motor: it runs, is stopped, is refused, is out of reach', async ({ bench, live }) => {
  const motor = card(live, 'st0/1');
  const running = motor.getByText(/^✓ Running/);
  await spin(live, 1000);
  await expect(motor.getByText(/^✓ Running to 1000 rpm\. The ramp took/)).toBeVisible();
  await motor.getByRole('button', { name: 'Stop', exact: true }).click();
  await expect(motor.getByText('Stopped: the motor confirmed it.')).toBeVisible();
  await expect(running).toHaveCount(0);
  await bench.rests();

  await live.keyboard.press('Escape');
  await expect(live.getByRole('button', { name: 'Release' })).toBeVisible();
  await motor.getByRole('button', { name: 'Run to target' }).click();
  await expect(motor.getByText(/latch/i)).toBeVisible();
  expect(await bench.speed('st', 1)).toBeLessThan(STILL);
  await live.getByRole('button', { name: 'Release' }).click();

  await spin(live, 1000);
  await bench.turns();
  await expect(motor.getByText('live', { exact: true })).toBeVisible();
  await bench.monitor.end('SIGKILL');
  await expect(live.getByText('Connection lost')).toBeVisible();
  await expect(running).toHaveCount(0);
  await expect(motor.getByText('live', { exact: true })).toHaveCount(0);
  await live.keyboard.press('Escape');
  await expect(live.getByText(/Not reachable/)).toBeVisible();
  await expect(live.getByText(/guard/).first()).toBeVisible();
});

test('what is said of a stop leaves room if many motors did not confirm', async ({ bench, page }) => {
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
  for (const [width, height] of [[390, 844], [1280, 800]] as const) {
    await page.setViewportSize({ width, height });
    await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
    const release = (await page.getByRole('button', { name: 'Release' }).boundingBox())!;
    expect(release.y + release.height, `${width} pixels`).toBeLessThan(0.6 * height);
    for (const name of [/STOP ALL/, 'Release', /^Close/]) {
      await expect(page.getByRole('button', { name }), `${width} pixels`).toBeInViewport({ ratio: 1 });
    }
  }
  await page.getByRole('button', { name: /^Close/ }).click();
  await expect(page.getByText(/did not confirm/)).toHaveCount(0);
  await page.getByRole('button', { name: 'Release' }).click();
  await expect(page.getByRole('button', { name: 'Release' })).toHaveCount(0);
});

test('a stop that was not confirmed is named on every page, also on one that is opened later', async ({ bench, live, viewer }) => {
  try {
    await expect(viewer.getByRole('article')).toHaveCount(6);
    bench.drives.process.kill('SIGSTOP');
    await live.keyboard.press('Escape');
    // The stop by HTTP is one of the monitor.
    const latch = viewer.getByRole('region', { name: 'Latch' });
    const named = /Stop of all by (page \d+|monitor)\. Not confirmed, may be turning: rmd0\/1, rmd0\/2, rmd0\/3 and 3 more\./;
    await expect(latch.getByText(named)).toBeVisible();
    // No search finds the motors now.
    await viewer.reload();
    await expect(latch.getByText(named)).toBeVisible();
    await expect(viewer.getByRole('article')).toHaveCount(6);
    await expect(card(viewer, 'st0/1').getByText('✕ silent')).toBeVisible();
    const report = /rmd0\/1, rmd0\/2, rmd0\/3 and 3 more did not confirm: they may still be turning/;
    await expect(live.getByText(report)).toBeVisible({ timeout: 60_000 });
    await open(live, 'Ports');
    await expect(live.getByRole('article', { name: 'Line st0' }).getByText('no motor answers')).toBeVisible();
    bench.drives.process.kill('SIGCONT');
    await expect(live.getByText('Stopped: 6 of 6 motors confirmed.')).toBeVisible({ timeout: 30_000 });
    await expect(latch.getByText(/^Stopped by (page \d+|monitor)\.$/)).toBeVisible();
  } finally {
    bench.drives.process.kill('SIGCONT');
  }
});
