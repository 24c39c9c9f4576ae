// Bad networks between a page and the server. Loss of packets is a stall here: TCP sends again, in order.
import { expect, test, type Page } from '@playwright/test';
import { Bench, card, spin } from './bench';
import { Chromium } from './chromium';
import { Network } from './network';

/** A value without an age is at most 1 s old. Cards are drawn each 100 ms, and the machine may be loaded. */
const MOST = 1000 + 500;

interface Bad {
  name: string;
  /** Makes the network bad. What it returns ends what it does again and again. */
  begin: (network: Network) => (() => void) | void;
  /** Nothing that is in time for the deadline gets through: the motor stops, and values get old. */
  isLate?: boolean;
  /** Values still come. */
  isFresh?: boolean;
  /** What the page says after STOP ALL. */
  stop: RegExp;
}

/** Does something now, and again and again. */
function again(ms: number, act: () => void) {
  act();
  const timer = setInterval(act, ms);
  return () => clearInterval(timer);
}

const STOPPED = /Stopped: \d+ of \d+ motors confirmed/;
const UNREACHED = /Not reachable/;
const EITHER = /Stopped: \d+ of \d+ motors confirmed|Not reachable/;

/** Those of each run come first; the others run with LONG=1. */
const NETWORKS: Bad[] = [
  { name: 'jitter', begin: (network) => network.set({ delay: 20, jitter: 400 }), stop: EITHER },
  { name: 'a cut to the browser', begin: (network) => network.set({ cut: 'to-browser' }), isLate: true, stop: UNREACHED },
  { name: 'a proxy that buffers', begin: (network) => network.set({ hoard: 16_384 }), isLate: true, stop: EITHER },
  { name: 'a connection that dies without a word', begin: (network) => network.abandon(), isLate: true, stop: EITHER },
  { name: 'a delay of 100 ms', begin: (network) => network.set({ delay: 100 }), stop: STOPPED },
  { name: 'a delay beyond the deadline', begin: (network) => network.set({ delay: 1200 }), isLate: true, stop: EITHER },
  { name: 'a narrow line', begin: (network) => network.set({ rate: 2000 }), stop: EITHER },
  {
    name: 'loss: stalls of 1 s',
    begin: (network) => {
      let isStalled = false;
      return again(1000, () => network.set({ cut: (isStalled = !isStalled) ? 'both' : 'no' }));
    },
    stop: EITHER,
  },
  {
    name: 'a cut to the server',
    begin: (network) => network.set({ cut: 'to-server' }),
    isLate: true,
    isFresh: true,
    stop: UNREACHED,
  },
  {
    name: 'resets in the middle of frames',
    begin: (network) => {
      network.set({ piece: 7, rate: 5000 });
      return again(700, () => network.drop());
    },
    isLate: true,
    stop: EITHER,
  },
  {
    name: 'a proxy that accepts and never answers',
    begin: (network) => {
      network.set({ cut: 'both' });
      network.drop();
    },
    isLate: true,
    stop: UNREACHED,
  },
  { name: 'a trickle of single bytes', begin: (network) => network.set({ piece: 1, rate: 100 }), isLate: true, stop: EITHER },
];

/** Notes what the card shows of the drive's clock, each 50 ms. */
const watch = (page: Page) =>
  page.evaluate(() => {
    const seen: [number, string, string][] = [];
    Object.assign(window, { seen });
    setInterval(() => {
      const one = document.querySelector('article[aria-label="Motor st0/1"]');
      const current = [...(one?.querySelectorAll('.value') ?? [])].find(
        (value) => value.querySelector('dt')?.textContent === 'Current',
      );
      if (!current) return;
      seen.push([
        Date.now(), current.querySelector('.digits')!.textContent!, current.querySelector('.age')!.textContent!,
      ]);
    }, 50);
  });

/** How old, by the clock of the drive, the oldest value was that had no age beside it, in ms. */
async function oldest(page: Page, started: number) {
  const seen = await page.evaluate(() => (window as unknown as { seen: [number, string, string][] }).seen.splice(0));
  const ages = seen.flatMap(([wall, digits, age]) => {
    const value = Number(digits.replace('\u2212', '-'));
    if (age !== '' || Number.isNaN(value)) return [];
    const past = (((wall - started - value) % 65_536) + 65_536) % 65_536;
    // The clocks of the browser and of the drive differ by some ms.
    return [past > 60_000 ? 0 : past];
  });
  return { count: ages.length, most: Math.max(0, ...ages) };
}

test('no bad network shows an old value as a live one', async () => {
  const bench = new Bench();
  const network = await Network.open();
  let chromium: Chromium | undefined;
  try {
    await bench.plugClock();
    await bench.serve(['-p', `${bench.folder}/st0`]);
    const { t } = (await bench.drives.tell({ command: 'state' })) as { t: number };
    const started = Date.now() - 1000 * t;
    chromium = await Chromium.open({ proxy: network.proxy });
    const page = await chromium.tab();
    await page.goto(bench.url);
    const motor = card(page, 'st0/1');
    await expect(motor.getByText('live', { exact: true })).toBeVisible();
    await watch(page);
    const report = page.getByRole('status', { name: 'Stop', exact: true });
    for (const { name, begin, isLate, isFresh, stop } of process.env.LONG ? NETWORKS : NETWORKS.slice(0, 4)) {
      await spin(page, 1000);
      await bench.turns('st', name);
      expect((await oldest(page, started)).count, name).toBeGreaterThan(0);
      const end = begin(network);
      try {
        if (isLate) await bench.rests('st', name);
        if (isLate && !isFresh) {
          await expect(motor.getByText(/\d s old|age unknown/).first(), name).toBeVisible();
        }
        await page.keyboard.press('Escape');
        await expect(report, name).toContainText(stop);
        if (STOPPED.test((await report.textContent())!)) {
          await bench.rests('st', name);
        }
      } finally {
        end?.();
        network.set({});
      }
      await expect(page.getByText(/Connected/), name).toBeVisible();
      await expect(motor.getByText('live', { exact: true }), name).toBeVisible();
      expect((await oldest(page, started)).most, name).toBeLessThan(MOST);
      // The stop is sent again with the next connection, and what was under way arrives.
      await expect(report, name).toContainText(STOPPED);
      await bench.rests('st', name);
      await page.getByRole('button', { name: 'Release' }).click();
      await expect(page.getByRole('button', { name: 'Release' })).toBeHidden();
    }
  } finally {
    await chromium?.close();
    await network.close();
    await bench.end();
  }
});
