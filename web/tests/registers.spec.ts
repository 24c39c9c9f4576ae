// Registers and settings files of simulated drives.
import type { Page } from '@playwright/test';
import { readFileSync } from 'node:fs';
import { expect, open, spin, test, violations } from './bench';

test.describe.configure({ timeout: 180_000 });

const row = (page: Page, name: string) => page.getByRole('row').filter({ has: page.getByText(name, { exact: true }) });

async function registers(page: Page, motor: string) {
  await open(page, 'Registers');
  await page.getByRole('combobox', { name: 'Motor' }).selectOption(motor);
}

/** Types a new value of a register. */
async function edit(page: Page, name: string, value: string) {
  await page.getByRole('button', { name: `Change ${name}`, exact: true }).click();
  const input = page.getByLabel(`New value of ${name}`);
  await expect(input).toBeFocused();
  await input.fill(value);
}

async function write(page: Page, name: string, value: string) {
  await edit(page, name, value);
  await page.keyboard.press('Enter');
  await expect(row(page, name).getByText(/Written, and read back/)).toBeVisible();
}

test('a register is changed in place, read back, and marked; what is not possible is not sent', async ({ live }) => {
  await registers(live, 'st0/1');
  await live.getByRole('searchbox', { name: 'Search' }).fill('speed kp');
  await expect(live.getByText('2 of 84 registers')).toBeVisible();
  const kp = row(live, 'SPEED_KP');
  const before = await kp.getByRole('status').first().textContent();
  await write(live, 'SPEED_KP', '251');
  await expect(kp.getByText(`changed, was ${before}`)).toBeVisible();
  await live.getByRole('button', { name: 'Read 2' }).click();
  await expect(live.getByText('2 registers were read.')).toBeVisible();
  await expect(kp.getByRole('status').first()).toHaveText('251');

  await edit(live, 'SPEED_KP', '40000');
  await live.keyboard.press('Enter');
  await expect(kp.getByText('Not sent. Out of range: -32768 to 32767 s16A/unit.')).toBeVisible();
  expect(await violations(live)).toEqual([]);
  // A click elsewhere keeps what was typed, as not written.
  await live.getByRole('heading', { name: 'Registers' }).click();
  await expect(kp.getByText('not written')).toBeVisible();
  await expect(live.getByText('1 with a value that is not written')).toBeVisible();
  await kp.getByRole('button', { name: 'Cancel' }).click();
  await expect(live.getByRole('button', { name: 'Change SPEED_KP', exact: true })).toBeVisible();
  // Refusals are said at the register.
  await live.getByRole('searchbox', { name: 'Search' }).fill('observer');
  await edit(live, 'OBSERVER_CR_C1', '5');
  await live.keyboard.press('Enter');
  await expect(row(live, 'OBSERVER_CR_C1').getByText(/Not confirmed: .*refused/)).toBeVisible();
});

test('settings are saved, compared and, at rest, restored', async ({ live, bench }) => {
  await registers(live, 'st0/1');
  await live.getByText('Settings files: save').click();
  const saved = live.waitForEvent('download');
  await live.getByRole('button', { name: 'Save settings of st0/1' }).click();
  const download = await saved;
  const buffer = readFileSync(await download.path());
  const load = (name: string, text: Buffer) =>
    live.getByLabel('Compare with a file').setInputFiles({ name, mimeType: 'text/plain', buffer: text });
  await load('same.toml', buffer);
  await expect(live.getByText('No setting differs.')).toBeVisible();
  await load('other.toml', Buffer.from('[rmd]\n'));
  await expect(live.getByText(/other.toml was not compared/)).toBeVisible();
  await load('notes.txt', Buffer.from('hello'));
  await expect(live.getByText(/not a settings file .* `motorlink st dump`.* line 1/)).toBeVisible();

  await write(live, 'SPEED_KP', '123');
  await load(download.suggestedFilename(), buffer);
  await expect(live.getByText('1 setting differs.')).toBeVisible();
  await expect(row(live, 'SPEED_KP').getByText(/≠ file/)).toBeVisible();
  await expect(live.getByRole('cell', { name: 'yes, at rest', exact: true })).toBeVisible();
  await open(live, 'Motors');
  await spin(live, 500);
  await open(live, 'Registers');
  await live.getByText('Settings files: save').click();
  const restore = live.getByRole('button', { name: 'Write 1 setting' });
  await restore.click();
  await expect(live.getByText(/nothing was written; stop it first/)).toBeVisible();

  await live.keyboard.press('Escape');
  await bench.rests();
  await restore.click();
  await expect(live.getByText('1 of 1 settings were written and read back. Nothing differs from the file now.')).toBeVisible();
  await expect(row(live, 'SPEED_KP').getByText(/≠ file/)).toBeHidden();
});

test('registers are read again after a stop; the ROM is written after a question, in which the stop works', async ({ live }) => {
  await spin(live, 1500);
  await registers(live, 'st0/1');
  await live.getByRole('button', { name: /^Read \d+$/ }).click();
  const status = row(live, 'STATUS').getByRole('status').first();
  // The motor may still be in its start procedure.
  await expect(status).toHaveText(/^(?!IDLE$)[A-Z_]+$/);
  await live.keyboard.press('Escape');
  await expect(status).toHaveText('IDLE');
  await expect(row(live, 'SPEED_REF').getByRole('status').first()).toHaveText('0');
  await live.getByRole('button', { name: 'Release' }).click();
  await expect(live.getByRole('button', { name: 'Release' })).toBeHidden();

  await registers(live, 'rmd0/1');
  await edit(live, 'encoder_offset', '7');
  await live.keyboard.press('Enter');
  const dialog = live.getByRole('dialog', { name: 'Write encoder_offset to the ROM?' });
  await expect(dialog).toContainText('Each write wears the ROM');
  await expect(dialog.getByRole('button', { name: 'Cancel' })).toBeFocused();
  await live.keyboard.press('Escape');
  await expect(dialog).toBeHidden();
  await expect(live.getByText(/Motion is refused until the latch is released/)).toBeVisible();
  await expect(row(live, 'encoder_offset').getByText('not written')).toBeVisible();

  await row(live, 'encoder_offset').getByRole('button', { name: 'Write' }).click();
  await dialog.getByRole('button', { name: 'Write 7' }).click();
  await expect(row(live, 'encoder_offset').getByText('Written, and read back: 7.')).toBeVisible();
});
