// How old what the page draws is, how smoothly it draws, and what it needs for long: `make view`,
// docs/BENCHMARKS.md. SECONDS: of the first part. MINUTES: of the second one, 0 without it; FILL: minutes before.
import { chromium, type Page, test } from '@playwright/test';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { card, expect, open } from './bench';
import { ARGUMENTS, Chromium, PROGRAM } from './chromium';
import { CLOCK, Fleet, ofAll, RATE, type SignalOf } from './fleet';
import { heap, resident } from './memory';
import { pageTime, type Places, probe } from './probe';
import { type Cell, publish, quantile, row, slope, table } from './report';
import { Stalls, STALL } from './stalls';

const SECONDS = Number(process.env.SECONDS ?? 60);
const MINUTES = Number(process.env.MINUTES ?? 10);
/** Plots keep 10 min. Until then their memory grows. */
const FILL = Number(process.env.FILL ?? 10);
const MS = 1000;
const MINUTE = 60 * MS;
const SAMPLE = 10 * MS;
const MB = 1e6;
/** A longer step between two samples interrupts a curve, in seconds: plot/store.ts. */
const GAP = 0.1;
const RPM = 1500;

/** The first three are what `probe` reads. */
const DRAWN: readonly SignalOf[] = [
  { line: 'st0', motor: 2, name: CLOCK },
  { line: 'st0', motor: 2, name: 'MIN_APP_SPEED' },
  { line: 'st0', motor: 2, name: 'MAX_APP_SPEED' },
  ...ofAll('rmd', 'speed_dps'),
  ...ofAll('st', 'TORQUE_MEAS'),
  { line: 'st1', motor: 1, name: 'SPEED_MEAS' },
];
const [THE_CLOCK, LOW, HIGH] = DRAWN as [SignalOf, SignalOf, SignalOf];

const pause = (ms: number) => new Promise((done) => setTimeout(done, ms));
const inMs = (all: number[]) => [0.5, 0.99, 1].map((share) => `${quantile(all, share).toFixed(0)} ms`).join(', ');
const recording = (page: Page) => page.locator('.top').getByRole('group', { name: 'Recording' });
/** The newest value beside a curve. */
const number = (page: Page, { line, motor, name }: SignalOf) =>
  page.locator(`tr[data-key="${line}/${motor}/${name}"] [data-is="now"]`);

/** The page of an operator, with 40 chosen signals. */
async function visit(page: Page, fleet: Fleet) {
  const settings = { signals: DRAWN.map((one) => ({ ...one, rate: RATE })), span: 60, layout: 'one' };
  await page.addInitScript((text) => localStorage.setItem('motorlink.plots', text), JSON.stringify(settings));
  await page.goto(fleet.url);
  await expect(page.getByRole('article')).toHaveCount(36, { timeout: MINUTE });
}

/** The samples of each signal in a CSV file of the page. */
function signalsOf(csv: string) {
  const [header, ...rows] = csv.trimEnd().split('\r\n').map((line) => line.split(','));
  return header!.slice(3).map((name, index) => {
    const cells = rows.filter((row) => row[index + 3] !== '');
    return { name, times: cells.map((row) => Number(row[2])), values: cells.map((row) => Number(row[index + 3])) };
  });
}

const rateOf = ({ times }: { times: number[] }) => (times.length - 1) / (times.at(-1)! - times[0]!);
const gapsOf = ({ times }: { times: number[] }) =>
  times.filter((time, index) => index > 0 && time - times[index - 1]! > GAP).length;

/** How old the samples of the clock were when the curve reached them. */
function ages(samples: number[], reached: { clock: number; value: number }[]): number[] {
  const found: number[] = [];
  let frame = 0;
  for (const sample of samples) {
    while (frame < reached.length && reached[frame]!.value < sample) frame += 1;
    // The first frame may have had older ones before.
    if (frame > 0 && frame < reached.length) found.push(reached[frame]!.clock - sample);
  }
  return found;
}

async function measure(page: Page, fleet: Fleet): Promise<Cell[][]> {
  const valueOf = async (signal: SignalOf) => Number(await number(page, signal).textContent());
  const [low, high] = [await valueOf(LOW), await valueOf(HIGH)];
  await number(page, THE_CLOCK).evaluate((cell) => probing.watch(cell));
  await page.evaluate(() => probing.clear());
  let best = { offset: NaN, error: Infinity };
  for (const end = performance.now() + SECONDS * MS; performance.now() < end; await pause(MS)) {
    const [clock, time] = [await fleet.clock(), await pageTime(page)];
    const error = clock.error + time.after - time.before;
    // The latest that the clock can show at this time of the page.
    const offset = clock.t * MS - clock.before + time.after - time.now;
    if (error < best.error) best = { offset, error };
  }
  const seen = await page.evaluate(() => probing.seen());
  const clockAt = (at: number) => at + best.offset;
  const drawn = ([clock, y0, y1]: Places) => Math.round(low + ((clock - y0) / (y1 - y0)) * (high - low));
  const steps = seen.frames.slice(1).map((at, index) => at - seen.frames[index]!);
  const span = (seen.frames.at(-1)! - seen.frames[0]!) / MS;
  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('button', { name: 'Export CSV' }).click(),
  ]);
  const signals = signalsOf(readFileSync(await download.path(), 'utf8'));
  const samples = signals.find(({ name }) => name.startsWith(`${THE_CLOCK.line}/${THE_CLOCK.motor} ${CLOCK}`))!.values;
  const curve = ages(samples, seen.curves.map(({ at, y }) => ({ clock: clockAt(at), value: drawn(y) })));
  return [
    ['sample to curve: median, 99 %, most', inMs(curve), 'p99 < 150 ms'],
    ['- samples of the clock', curve.length, ''],
    ['- the true times are less, at most by', `${best.error.toFixed(1)} ms`, ''],
    ['sample to number: median, 99 %, most', inMs(seen.numbers.map(({ at, value }) => clockAt(at) - value)), ''],
    ['frames a second', (steps.length / span).toFixed(1), '> 30'],
    ['- from frame to frame: median, 99 %, most', inMs(steps), ''],
    ['draws of 40 curves a second', (seen.draws / span).toFixed(1), '> 30'],
    ['least rate of a drawn signal', `${Math.min(...signals.map(rateOf)).toFixed(2)} Hz`, `${RATE} Hz`],
    ['gaps in 40 curves', signals.reduce((sum, one) => sum + gapsOf(one), 0), '0'],
    ['rows that the page lost', (await page.locator('.plots-lost').allTextContents()).join('') || 0, '0'],
  ];
}

/** Ends the recording of the page. */
async function endOwn(page: Page) {
  await recording(page).getByRole('button', { name: 'End recording' }).click();
  await expect(recording(page).getByRole('button', { name: '● Record' })).toBeEnabled({ timeout: MINUTE });
}

/** Ends the recording of all signals, and reads both files. */
async function recorded(fleet: Fleet): Promise<Cell[][]> {
  const { code, last, info } = await fleet.recorded();
  if (code !== 0) throw new Error(`the recorder has ended with ${code}`);
  const own = fleet.ownRecording();
  const lost = ({ lost_messages: messages, unconfirmed_rows: rows, lost: damage }: typeof own) =>
    `${messages}, not confirmed ${rows}${damage ? `, ${damage.why}` : ''}`;
  return [
    ['values in the recording of all signals', String(last.values), ''],
    ['- least rate of a signal', `${Number(last.achieved_hz).toFixed(2)} Hz`, `${RATE} Hz`],
    ['- rows lost', lost(info), '0'],
    ['messages in the recording of the page', own.messages, ''],
    ['- rows lost', lost(own), '0'],
  ];
}

const megabytes = (bytes: number) => (bytes / MB).toFixed(1);

/** The memory of processes each 10 s, with the time in minutes. `look` is called before each. */
async function watch(minutes: number, processes: () => number[], look = async () => {}) {
  const samples: { minute: number; sizes: number[] }[] = [];
  const began = performance.now();
  for (let next = began; next <= began + minutes * MINUTE; next += SAMPLE) {
    await pause(next - performance.now());
    await look();
    const sizes = processes().map(resident);
    const minute = (performance.now() - began) / MINUTE;
    samples.push({ minute, sizes });
    console.log(row([`${minute.toFixed(1)} min`, ...sizes.map((size) => `${megabytes(size)} MB`)]));
  }
  /** The memory of the process at `index`, from the minute `since` on. */
  return (index: number, since = 0) => {
    const part = samples.filter(({ minute }) => minute >= since);
    const sizes = part.map((sample) => sample.sizes[index]! / MB);
    const day = slope(part.map(({ minute }, at) => [minute / 60 / 24, sizes[at]!] as const));
    return `${sizes[0]!.toFixed(0)} to ${sizes.at(-1)!.toFixed(0)} MB, ${day.growth.toFixed(0)} ± ${day.error.toFixed(0)} MB`;
  };
}

/**
 * One window holds a motor, and the one that draws turns another motor. Before, plots fill their memory while the
 * page records.
 */
async function soak(draws: Chromium, holds: Chromium, fleet: Fleet): Promise<Cell[][]> {
  const windows = [draws, holds];
  const server = fleet.monitor.process.pid!;
  for (const one of windows) await visit(await one.tab(), fleet);
  await open(draws.page, 'Plots');
  const filled = FILL > 0 ? await watch(FILL, () => [server]) : undefined;
  await endOwn(draws.page);

  const motor = () => card(holds.page, 'st0/1');
  await motor().getByRole('switch', { name: 'Hold to run' }).check();
  await motor().getByRole('spinbutton', { name: 'Target, rpm' }).fill(String(RPM));
  const hold = async () => {
    await holds.page.keyboard.up('h');
    await motor().getByRole('button', { name: 'Hold to run' }).focus();
    await holds.page.keyboard.down('h');
  };
  // The test does not look whether it runs: what it looks for in a page takes up to 0.3 s of the page's time.
  const turn = async () => {
    await open(draws.page, 'Motors');
    const turned = card(draws.page, 'st1/1');
    await turned.getByRole('spinbutton', { name: 'Target, rpm' }).fill(String(RPM));
    await turned.getByRole('button', { name: 'Run to target' }).click();
    await draws.page.getByRole('navigation').getByRole('link', { name: 'Plots' }).click();
  };
  const standing = async () => {
    const speeds = [await fleet.speedAt(0, 1), await fleet.speedAt(1, 1)];
    return speeds.map((speed) => speed < RPM / 2) as [held: boolean, turned: boolean];
  };
  const run = async () => {
    for (let [held, turned] = await standing(); held || turned; [held, turned] = await standing()) {
      if (held) await hold();
      if (turned) await turn();
      await pause(SAMPLE);
    }
  };
  const heaps = () => Promise.all(windows.map(({ page }) => heap(page)));
  const before = await heaps();
  await run();

  // The others have no page.
  const largest = (all: number[]) => all.reduce((one, other) => (resident(one) > resident(other) ? one : other));
  const pages = (await Promise.all(windows.map((one) => one.renderers()))).map(largest);
  for (const one of windows) await one.leave();
  let stops = 0;
  const stalls = new Stalls();
  const memory = await watch(MINUTES, () => [server, ...pages], async () => {
    const count = (await standing()).filter(Boolean).length;
    if (count === 0) return;
    stops += count;
    const told = fleet.monitor.lines.filter(({ line, event }) => String(line).startsWith('st') || event === 'left');
    console.log('a motor stands', stalls.found.slice(-3), ...told.slice(-6).map(({ message }) => message));
    for (const one of windows) await one.join();
    await run();
    for (const one of windows) await one.leave();
  });
  const stalled = await stalls.end();
  for (const one of windows) await one.join();
  await holds.page.keyboard.up('h');
  const after = await heaps();

  const use = (at: number, part: 'objects' | 'arrays') =>
    `${megabytes(before[at]![part])} to ${megabytes(after[at]![part])} MB`;
  return [
    ['motors that were found standing', stops, '0'],
    [`- stalls of the computer above ${STALL} ms, longest`, `${stalled.length}, ${Math.max(0, ...stalled).toFixed(0)} ms`, ''],
    ['server: memory, growth in 24 h', memory(0), 'none'],
    ...(['page that draws', 'page that holds'] as const).flatMap((name, at) => [
      [`${name}: memory of its process, growth in 24 h`, memory(at + 1, MINUTES / 2), 'none'],
      ['- objects, after a collection of garbage', use(at, 'objects'), 'none'],
      ['- samples', use(at, 'arrays'), 'none'],
    ]),
    ...(filled ? [['server that records: memory, growth in 24 h', filled(0, FILL / 2), 'the index of the file']] : []),
  ];
}

test('view', async () => {
  const whole = MINUTES > 0 ? (MINUTES + FILL + 1) * MINUTE : 0;
  test.setTimeout(SECONDS * MS + 3 * MINUTE + whole);
  const rows: Cell[][] = [];
  const add = (more: Cell[][]) => {
    rows.push(...more);
    for (const one of more) console.log(row(one));
  };
  const fleet = new Fleet();
  const browsers: { close: () => Promise<void> }[] = [];
  const opened = <B extends { close: () => Promise<void> }>(browser: B) => {
    browsers.push(browser);
    return browser;
  };
  try {
    await fleet.plug();
    fleet.turn('rmd0');
    const browser = opened(await chromium.launch({ executablePath: PROGRAM, args: ARGUMENTS }));
    const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
    await probe(page);
    await visit(page, fleet);
    await recording(page).getByRole('button', { name: '● Record' }).click();
    await expect(recording(page)).toContainText(/REC \d\d:0[1-9]/, { timeout: MINUTE });
    await fleet.record();
    await open(page, 'Plots');
    await expect(number(page, HIGH)).toHaveText(/^\d+$/, { timeout: MINUTE });
    add(await measure(page, fleet));
    if (MINUTES === 0) await endOwn(page);
    await browser.close();
    // A browser draws one of its pages only.
    if (MINUTES > 0) add(await soak(opened(await Chromium.open()), opened(await Chromium.open()), fleet));
    add(await recorded(fleet));
    const size = execFileSync('npm', ['run', '--silent', 'size']).toString().trim();
    add([['the page', size.replace('the page: ', ''), '< 200 kB']]);
    publish('view', table(['what', 'measured', 'goal'], rows, 3));
  } finally {
    await Promise.all(browsers.map((browser) => browser.close()));
    await fleet.end();
  }
});
