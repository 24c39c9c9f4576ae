// Faults of a drive, a cable that goes and comes back, and a viewer beside an operator.
import { card, expect, open, spin, STILL, test } from './bench';

test('a fault is shown with what to do, in the header of every view, and acknowledged', async ({ bench, live }) => {
  const inject = (motor: number, fault: string) =>
    bench.drives.tell({ command: 'fault', port: `pty:${bench.folder}/st0`, motor, fault });
  await spin(live, 1000);
  await bench.turns();
  const SIZES = [[390, 844], [800, 600], [1280, 800]] as const;
  const size = () => live.locator('.top header').evaluate((header) => {
    const boxes = [...header.querySelectorAll('h1, .stop-all, .status, .all-faults')].map((one) => one.getBoundingClientRect());
    return Math.max(...boxes.map(({ bottom }) => bottom));
  });
  const faults = live.getByRole('status', { name: 'Faults of all motors' });
  await expect(faults).toBeEmpty();
  const before: number[] = [];
  for (const [width, height] of SIZES) {
    await live.setViewportSize({ width, height });
    before.push(await size());
  }

  expect(await inject(1, 'BREAK_IN')).toEqual({ ok: true });
  const motor = card(live, 'st0/1');
  const fault = motor.getByRole('list', { name: 'Faults' }).getByRole('listitem');
  await expect(fault.getByText(/BREAK_IN \(occurred, not acknowledged\)/)).toBeVisible();
  // Its meaning, and what to do.
  await expect(fault.getByRole('paragraph')).toHaveText(/\w+.*\. \w+.*\./);
  await expect(motor.getByText('1 fault', { exact: false }).first()).toBeVisible();
  await bench.rests();

  await open(live, 'Events');
  await inject(2, 'OVER_VOLT');
  const link = faults.getByRole('link', { name: '2 faults: st0/1, st0/2' });
  await expect(link).toBeVisible();
  for (const [at, [width, height]] of SIZES.entries()) {
    await live.setViewportSize({ width, height });
    expect(await size(), `${width} pixels`).toBe(before[at]);
    const box = (await faults.boundingBox())!;
    const stop = (await live.getByRole('button', { name: /STOP ALL/ }).boundingBox())!;
    expect(box.x + box.width, `${width} pixels`).toBeLessThan(stop.x);
    expect(await live.evaluate(() => document.documentElement.scrollWidth)).toBe(width);
  }
  await link.click();
  await expect(live.getByRole('heading', { name: 'Motors', level: 2 })).toBeVisible();

  await motor.getByRole('button', { name: 'Acknowledge faults' }).click();
  await expect(motor.getByText('Faults acknowledged.')).toBeVisible();
  await expect(motor.getByText(/no faults/)).toBeVisible();
  await spin(live, 1000);
  await bench.turns();
});

test('a cable that goes and comes back needs no click', async ({ bench, live }) => {
  const motor = card(live, 'st0/1');
  await spin(live, 1000);
  await bench.turns();
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
  await bench.turns();
});

test('a viewer beside an operator sees the motion, changes nothing, and can stop', async ({ bench, live, viewer }) => {
  await expect(viewer.getByRole('article')).toHaveCount(6);
  await open(viewer, 'Registers');
  await viewer.getByRole('combobox', { name: 'Motor' }).selectOption('st0/1');
  await viewer.getByRole('searchbox', { name: 'Search' }).fill('bus_voltage');
  await expect(viewer.getByRole('row', { name: 'BUS_VOLTAGE' }).getByText('V', { exact: true })).toBeVisible();
  await expect(viewer.getByRole('button', { name: /^Change/ })).toHaveCount(0);
  await open(viewer, 'Step response');
  await viewer.getByLabel(/^From/).fill('1000');
  await viewer.getByLabel(/^To/).fill('1500');
  await expect(viewer.getByText('A viewer cannot move motors.')).toBeVisible();
  await expect(viewer.getByRole('button', { name: 'Apply the step' })).toBeDisabled();
  await open(viewer, 'Ports');
  await expect(viewer.getByText('Operators open and close lines.')).toBeVisible();
  await expect(viewer.getByRole('form', { name: 'Open a port' })).toHaveCount(0);
  await expect(viewer.getByRole('button', { name: /^Close/ })).toHaveCount(0);
  await open(viewer, 'Motors');

  const seen = card(viewer, 'st0/1');
  await spin(live, 1000);
  const speed = seen.locator('.value').filter({ hasText: 'Speed' }).locator('.digits');
  await expect.poll(async () => Number(await speed.textContent())).toBeGreaterThan(300);
  await expect(seen.getByText('live', { exact: true })).toBeVisible();
  for (const name of ['Start', 'Acknowledge faults', 'Run to target']) {
    await expect(seen.getByRole('button', { name, exact: true })).toBeDisabled();
  }
  await seen.getByRole('button', { name: 'Stop', exact: true }).click();
  await bench.rests();
  await expect(seen.getByText('Stopped: the motor confirmed it.')).toBeVisible();
});
