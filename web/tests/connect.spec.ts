// Ports of the computer, and lines that are opened and closed while the server runs.
import type { Page } from '@playwright/test';
import { writeFileSync } from 'node:fs';
import { type AddressInfo, connect, createServer } from 'node:net';
import { Bench, card, expect, open, Program, spin, test as base, violations } from './bench';

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

async function fill(page: Page, port: string, protocol: string, timeout = 2000) {
  const form = page.getByRole('form', { name: 'Open a port' });
  await form.getByRole('textbox', { name: 'Port' }).fill(port);
  await form.getByRole('combobox', { name: 'Protocol' }).selectOption(protocol);
  await form.getByRole('textbox', { name: /^Reply timeout/ }).fill(String(timeout));
  return form;
}

async function enter(page: Page, port: string, protocol: string) {
  const form = await fill(page, port, protocol);
  await form.getByRole('button', { name: 'Open' }).click();
  return form.getByRole('status').last();
}

/** A CAN adapter behind TCP whose bus has 500 kbit/s: at other bit rates no frame passes. */
async function slowBus(drives: number) {
  const server = createServer((host) => {
    const bus = connect(drives, '127.0.0.1');
    let isRight = false;
    let text = '';
    host.on('data', (bytes) => {
      text += bytes.toString('latin1');
      const lines = text.split('\r');
      text = lines.pop()!;
      for (const line of lines) {
        if (line.startsWith('S')) isRight = line === 'S6';
        if (isRight || !line.startsWith('t')) bus.write(`${line}\r`);
      }
    });
    bus.on('data', (bytes) => host.write(bytes));
    for (const [one, other] of [[host, bus], [bus, host]] as const) {
      one.on('close', () => other.destroy()).on('error', () => other.destroy());
    }
  });
  await new Promise<void>((done) => server.listen(0, '127.0.0.1', done));
  return { port: (server.address() as AddressInfo).port, close: () => server.close() };
}

test('a line is opened, turned, and closed, which stops its motors, and a viewer sees it', async ({ bench, page, viewer }) => {
  const port = `slcan:${bench.folder}/can0`;
  await open(viewer, 'Ports');
  await page.goto(bench.url);
  await expect(page.getByRole('article')).toHaveCount(2);
  await open(page, 'Ports');
  await expect(line(page, 'st0')).toContainText(/0 without reply, \d+ refused, 0 failed, of \d+ exchanges \(searches of empty addresses count\); port never lost/);
  await expect(await enter(page, port, 'rmd')).toContainText('it is the line rmd0');
  await expect(line(page, 'rmd0')).toContainText(port);
  await expect(line(viewer, 'rmd0')).toContainText('1234');
  await expect(await enter(page, port, 'rmd')).toContainText('is open already: it is the line rmd0');
  await expect(await enter(page, '/dev/null', 'st')).toContainText('is not opened');
  expect(await violations(page)).toEqual([]);
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  expect(overflow).toBeLessThanOrEqual(0);
  const close = line(page, 'rmd0').getByRole('button', { name: 'Close rmd0' });
  const dialog = page.getByRole('dialog');
  // Axe keeps the page busy, maybe for longer than the deadline of a motor.
  await close.click();
  expect(await violations(page)).toEqual([]);
  await dialog.getByRole('button', { name: 'Cancel' }).click();

  await open(page, 'Motors');
  await spin(page, 600, 'rmd0/1');
  await bench.turns('rmd');
  await open(page, 'Ports');
  await close.click();
  await dialog.getByRole('button', { name: 'Close it' }).click();
  const closed = page.getByText(/^\S* ?rmd0 is closed\./);
  await expect(closed).toBeVisible();
  // The signs of life of a page that gets no time end before: its motors are stopped then.
  if (!await page.getByText('The motors that this page turned were stopped.').isVisible()) {
    await expect(closed).toContainText('Stopped before: motor 1.');
  }
  await expect(line(page, 'rmd0')).toHaveCount(0);
  await expect(line(viewer, 'rmd0')).toHaveCount(0);
  await bench.rests('rmd');
  await expect(await enter(page, port, 'rmd')).toContainText('it is the line rmd1');
});

test('a scan finds the bit rate and the motors of a bus, after a question', async ({ bench, page }) => {
  const more = new Bench();
  const bus = await slowBus(await more.listen('rmd'));
  try {
    await page.goto(bench.url);
    await open(page, 'Ports');
    const form = await fill(page, `slcan:tcp:127.0.0.1:${bus.port}`, 'rmd', 300);
    const scan = form.getByRole('button', { name: 'Scan' });
    const said = form.getByRole('status').first();
    const dialog = page.getByRole('dialog', { name: 'Try other bit rates?' });
    await scan.click();
    await expect(dialog).toBeVisible();
    expect(await violations(page)).toEqual([]);
    await dialog.getByRole('button', { name: 'Cancel' }).click();
    await expect(said).toHaveText('No motor answered. Other bit rates were not tried.');

    await scan.click();
    await dialog.getByRole('button', { name: 'Try them' }).click();
    await form.getByRole('button', { name: 'End the scan' }).click();
    await expect(said).toHaveText(/^The scan was ended after [12] of 9 rates\.$/);

    await scan.click();
    await dialog.getByRole('button', { name: 'Try them' }).click();
    const found = form.getByRole('list', { name: 'What answered' }).getByRole('listitem');
    await expect(found).toHaveText([
      '1000 kbit/ssilence', '800 kbit/ssilence', '500 kbit/smotors 1, 2, 3, 4',
    ]);
    await expect(form.getByRole('textbox', { name: 'Port' })).toHaveValue(/\?bitrate=500000$/);
    expect(await violations(page)).toEqual([]);
    await form.getByRole('button', { name: 'Open' }).click();
    await open(page, 'Motors');
    await expect(card(page, 'rmd0/4')).toBeVisible();
  } finally {
    bus.close();
    await more.end();
  }
});

/** The values of a card that look like present ones. */
const liveOnes = async (page: Page, name: string) =>
  (await card(page, name).locator('.value:not(.old) .digits').allInnerTexts()).filter((text) => text !== '–');

test('no old value looks live when the share is another one, and the page says that it outlives the monitor', async ({ bench, page }) => {
  await bench.monitor.end();
  const at = `unix:${bench.folder}/share`;
  const begin = async () => {
    const share = new Program(['share', '-p', `slcan:${bench.folder}/can0`, '--timeout', '1s', '--at', at, '--json'], bench.folder);
    await share.line(({ event }) => event === 'ready');
    return share;
  };
  const first = await begin();
  const begun = performance.now();
  let second: Program | undefined;
  try {
    await bench.serve(['--share', at]);
    await page.goto(bench.url);
    // The clock of the second share is that of the first one again only after this time.
    await expect
      .poll(async () => performance.now() - begun > 8000 && (await liveOnes(page, 'rmd0/4')).length > 0, { timeout: 20_000 })
      .toBe(true);
    await first.end('SIGKILL');
    await bench.drives.end();
    await expect.poll(() => liveOnes(page, 'rmd0/4')).toEqual([]);
    writeFileSync(`${bench.folder}/one.toml`, '[[rmd.motor]]\nid = 1\n');
    bench.drives = new Program(
      ['sim', `${bench.folder}/one.toml`, '--rmd', `slcan-pty:${bench.folder}/can0`, '--stdin', '--json'],
      bench.folder,
    );
    await bench.drives.line((line) => line['protocol'] === 'rmd');
    second = await begin();
    const until = performance.now() + 3000;
    let isBack = false;
    while (!isBack || performance.now() < until) {
      expect(await liveOnes(page, 'rmd0/4')).toEqual([]);
      isBack ||= (await liveOnes(page, 'rmd0/1')).length > 0;
    }
    await expect(card(page, 'rmd0/4').locator('.value.old').first()).toBeVisible();

    await spin(page, 600, 'rmd0/1');
    await bench.turns('rmd');
    await bench.monitor.end('SIGKILL');
    await expect(page.getByText(/the share, which is another process, has stopped the motors of this page/)).toBeVisible();
    await bench.rests('rmd');
  } finally {
    await first.end();
    await second?.end();
  }
});
