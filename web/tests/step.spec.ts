// Step responses of simulated drives.
import type { Page } from '@playwright/test';
import { readFileSync } from 'node:fs';
import { expect, open, test, violations } from './bench';

async function setUp(page: Page, motor: string, from: number, to: number) {
  await open(page, 'Step response');
  await page.getByRole('combobox', { name: 'Motor' }).selectOption(motor);
  await page.getByLabel(/^From/).fill(String(from));
  await page.getByLabel(/^To/).fill(String(to));
  await page.getByLabel('Record for').fill('3');
}

const apply = (page: Page) => page.getByRole('button', { name: 'Apply the step' }).click();

test('a step of an ST drive: what it is like, the gains, the files', async ({ live, bench }) => {
  await setUp(live, 'st0/1', 1000, 1500);
  await expect(live.getByText('st0/1 goes from its measured speed to 1000 rpm at 750 rpm/s.')).toBeVisible();
  await apply(live);
  await expect(live.getByText(/^✓ Run 1 is recorded.*The motor has stopped\.$/)).toBeVisible({ timeout: 60_000 });
  await bench.rests();
  // What was entered stays while another view is open.
  await open(live, 'Registers');
  await open(live, 'Step response');
  await expect(live.getByLabel(/^From/)).toHaveValue('1000');

  const table = live.getByRole('region', { name: 'Comparison of the runs' });
  const overshoot = table.getByRole('row', { name: /^Overshoot/ }).getByRole('cell');
  await expect(overshoot).toHaveText(/^(below )?[\d.]+ (± [\d.]+ )?%/);
  await expect(table.getByRole('row', { name: /^SPEED_KP / }).getByRole('cell')).toHaveText('249 s16A/unit');
  expect(await violations(live)).toEqual([]);

  const saved = live.waitForEvent('download');
  await live.getByRole('button', { name: 'Save run 1 as CSV' }).click();
  const lines = readFileSync(await (await saved).path(), 'utf8').split('\n');
  expect(lines).toContain('# SPEED_KP = 249 s16A/unit');
  const rows = lines.filter((line) => /^-?\d/.test(line)).map((line) => line.split(',').map(Number));
  expect(rows.length).toBeGreaterThan(50);
  expect(rows[0]![0]).toBeLessThan(-0.2);
  expect(Math.abs(rows.at(-1)![1]! - 1500)).toBeLessThan(30);

  // The runs are there after a reload.
  await live.reload();
  await expect(live.getByText('1: st0/1, speed 1000 to 1500 rpm').first()).toBeVisible();
});

test('what ends a step stops the motor', async ({ live, bench }) => {
  const begin = async () => {
    await setUp(live, 'rmd0/1', 600, 900);
    await apply(live);
    await bench.turns('rmd');
  };

  await begin();
  await live.keyboard.press('Escape');
  await expect(live.getByText(/^! Aborted\. .*Stopped: the motor confirmed it/)).toBeVisible();
  await bench.rests('rmd');
  await expect(live.getByRole('button', { name: 'Apply the step' })).toBeDisabled();
  await live.getByRole('button', { name: 'Release' }).click();

  await begin();
  await live.getByRole('button', { name: 'End and stop the motor' }).click();
  await expect(live.getByText('! Aborted. You ended it. Stopped: the motor confirmed it.')).toBeVisible();
  await bench.rests('rmd');

  await begin();
  await open(live, 'Registers');
  await bench.rests('rmd');
});
