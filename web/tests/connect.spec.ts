// Ports of the computer, and lines that are opened and closed while the server runs.
import AxeBuilder from '@axe-core/playwright';
import type { Page } from '@playwright/test';
import { Bench, card, expect, open, test as base } from './bench';

/** A monitor with the ST drive alone. */
const test = base.extend<{ bench: Bench }>({
  bench: async ({}, use) => {
    const bench = new Bench();
    try {
      await bench.plug();
      await bench.serve(['-p', `${bench.folder}/st0`]);
      await use(bench);
    } finally {
      await bench.end();
    }
  },
});

const line = (page: Page, name: string) => page.getByRole('article', { name: `Line ${name}` });

async function enter(page: Page, port: string, protocol: string) {
  const form = page.getByRole('form', { name: 'Open a port' });
  await form.getByRole('textbox', { name: 'Port' }).fill(port);
  await form.getByRole('combobox', { name: 'Protocol' }).selectOption(protocol);
  await form.getByRole('textbox', { name: /^Reply timeout/ }).fill('2000');
  await form.getByRole('button', { name: 'Open' }).click();
  return form.getByRole('status');
}

test('a line is opened, turned, and closed, which stops its motors', async ({ bench, page }) => {
  const port = `slcan:${bench.folder}/can0`;
  await page.goto(bench.url);
  await expect(page.getByRole('article')).toHaveCount(2);
  await open(page, 'Ports');
  await expect(line(page, 'st0')).toContainText(/0 without reply, \d+ refused, 0 failed, of \d+ exchanges; port never lost/);
  await expect(await enter(page, port, 'rmd')).toContainText('it is the line rmd0');
  await expect(line(page, 'rmd0')).toContainText(port);
  await expect(await enter(page, port, 'rmd')).toContainText('is open already: it is the line rmd0');
  await expect(await enter(page, '/dev/null', 'st')).toContainText('is not opened');
  expect((await new AxeBuilder({ page }).analyze()).violations).toEqual([]);
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  expect(overflow).toBeLessThanOrEqual(0);

  await open(page, 'Motors');
  const motor = card(page, 'rmd0/1');
  await motor.getByRole('spinbutton', { name: /^Target/ }).fill('300');
  await motor.getByRole('button', { name: 'Run to target' }).click();
  await expect.poll(() => bench.speed('rmd', 1)).toBeGreaterThan(100);
  await open(page, 'Ports');
  await line(page, 'rmd0').getByRole('button', { name: 'Close rmd0' }).click();
  const dialog = page.getByRole('dialog');
  expect((await new AxeBuilder({ page }).analyze()).violations).toEqual([]);
  await dialog.getByRole('button', { name: 'Close it' }).click();
  await expect(page.getByText('rmd0 is closed. Stopped before: motor 1.')).toBeVisible();
  await expect(line(page, 'rmd0')).toHaveCount(0);
  await expect.poll(async () => Math.abs(await bench.speed('rmd', 1))).toBeLessThan(10);
  await open(page, 'Motors');
  await expect(page.getByRole('article')).toHaveCount(2);
  await open(page, 'Ports');
  await expect(await enter(page, port, 'rmd')).toContainText('it is the line rmd1');
});

test('a viewer sees lines come and go, and opens none', async ({ bench, page, browser }) => {
  await page.goto(bench.url);
  await open(page, 'Ports');
  const context = await browser.newContext();
  try {
    const viewer = await context.newPage();
    await viewer.goto(bench.viewerUrl);
    await open(viewer, 'Ports');
    await expect(viewer.getByText('Operators open and close lines.')).toBeVisible();
    await expect(viewer.getByRole('form', { name: 'Open a port' })).toHaveCount(0);
    await expect(viewer.getByRole('button', { name: /^Close/ })).toHaveCount(0);
    const reasons = await viewer.evaluate(
      (port) =>
        new Promise<string[]>((done) => {
          const socket = new WebSocket(new URL('ws', location.href.replace(/^http/, 'ws')));
          const heard: string[] = [];
          socket.onmessage = ({ data }) => {
            const text = typeof data === 'string' ? (JSON.parse(data) as { kind: string; reason?: string }) : null;
            if (text?.kind === 'welcome') {
              socket.send(JSON.stringify({ id: 1, ask: 'open', port, protocol: 'rmd' }));
              socket.send(JSON.stringify({ id: 2, ask: 'close', line: 'st0' }));
            }
            if (text?.kind === 'refusal') heard.push(String(text.reason));
            if (heard.length === 2) done(heard);
          };
        }),
      `slcan:${bench.folder}/can0`,
    );
    expect(reasons).toEqual(['forbidden', 'forbidden']);
    await expect(await enter(page, `slcan:${bench.folder}/can0`, 'rmd')).toContainText('it is the line rmd0');
    await expect(line(viewer, 'rmd0')).toBeVisible();
    await expect(line(viewer, 'rmd0')).toContainText('1234');
  } finally {
    await context.close();
  }
});
