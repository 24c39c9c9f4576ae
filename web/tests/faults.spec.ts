// Faults of a drive, a cable that goes and comes back, and a viewer beside an operator.
import { card, expect, open, spin, STILL, test, TURNS } from './bench';

test('a fault is shown in words, with what to do, and acknowledged', async ({ bench, live }) => {
  await spin(live, 1000);
  await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
  const answer = await bench.drives.tell({
    command: 'fault', port: `pty:${bench.folder}/st0`, motor: 1, fault: 'BREAK_IN',
  });
  expect(answer).toEqual({ ok: true });
  const motor = card(live, 'st0/1');
  const fault = motor.getByRole('list', { name: 'Faults' }).getByRole('listitem');
  await expect(fault.getByText(/BREAK_IN \(occurred, not acknowledged\)/)).toBeVisible();
  // Its meaning, and what to do.
  await expect(fault.getByRole('paragraph')).toHaveText(/\w+.*\. \w+.*\./);
  await expect(motor.getByText('1 fault', { exact: false }).first()).toBeVisible();
  await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
  await motor.getByRole('button', { name: 'Acknowledge faults' }).click();
  await expect(motor.getByText('Faults acknowledged.')).toBeVisible();
  await expect(motor.getByText(/no faults/)).toBeVisible();
  await spin(live, 1000);
  await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
});

for (const [width, height] of [[390, 844], [800, 600], [1280, 800]] as const) {
  test(`a fault is in the header of every view, ${width} pixels`, async ({ bench, live }) => {
    await live.setViewportSize({ width, height });
    const size = async () => (await live.locator('.top header').evaluate((header) => {
      const boxes = [...header.querySelectorAll('h1, .stop-all, .status, .all-faults')].map((one) => one.getBoundingClientRect());
      return Math.max(...boxes.map(({ bottom }) => bottom));
    }));
    await open(live, 'Events');
    const before = await size();
    const faults = live.getByRole('status', { name: 'Faults of all motors' });
    await expect(faults).toBeEmpty();
    for (const motor of [1, 2]) {
      await bench.drives.tell({ command: 'fault', port: `pty:${bench.folder}/st0`, motor, fault: 'OVER_VOLT' });
    }
    await expect(faults.getByRole('link', { name: '2 faults: st0/1, st0/2' })).toBeVisible();
    expect(await size()).toBe(before);
    const link = (await faults.boundingBox())!;
    const stop = (await live.getByRole('button', { name: /STOP ALL/ }).boundingBox())!;
    expect(link.x + link.width).toBeLessThan(stop.x);
    expect(await live.evaluate(() => document.documentElement.scrollWidth)).toBe(width);
    await faults.getByRole('link').click();
    await expect(live.getByRole('heading', { name: 'Motors', level: 2 })).toBeVisible();
  });
}

test('a cable that goes and comes back needs no click', async ({ bench, live }) => {
  const motor = card(live, 'st0/1');
  await spin(live, 1000);
  await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
  await bench.drives.end();
  await expect(motor.getByText(/\d s old/).first()).toBeVisible();
  await expect(motor.getByText('not live')).toBeVisible();
  await open(live, 'Ports');
  await expect(live.getByText(/lost since|✕ lost/).first()).toBeVisible();
  await open(live, 'Motors');
  await bench.plug();
  await expect(motor.getByText('live', { exact: true })).toBeVisible();
  expect(await bench.speed('st', 1)).toBeLessThan(STILL);
  await spin(live, 1000);
  await expect.poll(() => bench.speed('st', 1)).toBeGreaterThan(TURNS);
});

test('a viewer beside an operator sees the motion, cannot move, and can stop', async ({ bench, live, browser }) => {
  const context = await browser.newContext();
  try {
    const viewer = await context.newPage();
    await viewer.goto(bench.viewerUrl);
    const seen = card(viewer, 'st0/1');
    await spin(live, 1000);
    const speed = seen.locator('.value').filter({ hasText: 'Speed' }).locator('.digits');
    await expect.poll(async () => Number(await speed.textContent())).toBeGreaterThan(TURNS);
    await expect(seen.getByText('live', { exact: true })).toBeVisible();
    for (const name of ['Start', 'Acknowledge faults', 'Run to target']) {
      await expect(seen.getByRole('button', { name, exact: true })).toBeDisabled();
    }
    await seen.getByRole('button', { name: 'Stop', exact: true }).click();
    await expect.poll(() => bench.speed('st', 1)).toBeLessThan(STILL);
    await expect(seen.getByText('Stopped: the motor confirmed it.')).toBeVisible();
  } finally {
    await context.close();
  }
});
