// How old what the page draws is, how smoothly it draws, and what it needs for long: `make view`,
// docs/BENCHMARKS.md. SECONDS: of the first part. MINUTES: of the second one, 0 without it; FILL: minutes before.
import { type Browser, chromium, type Page, test } from '@playwright/test';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { card, expect, open, spin } from './bench';
import { ARGUMENTS, PROGRAM } from './chromium';
import { CLOCK, Fleet, ofAll, RATE, type SignalOf } from './fleet';
import { heap, ofRenderers, resident } from './memory';
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

const launch = () => chromium.launch({ executablePath: PROGRAM, args: ARGUMENTS });
const pause = (ms: number) => new Promise((done) => setTimeout(done, ms));
const inMs = (all: number[]) => [0.5, 0.99, 1].map((share) => `${quantile(all, share).toFixed(0)} ms`).join(', ');
const recording = (page: Page) => page.locator('.top').getByRole('group', { name: 'Recording' });
/** The newest value beside a curve. */
const number = (page: Page, { line, motor, name }: SignalOf) =>
  page.locator(`tr[data-key="${line}/${motor}/${name}"] [data-is="now"]`);

/** The page of an operator, with 40 chosen signals. */
async function visit(browser: Browser, fleet: Fleet): Promise<Page> {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  await probe(page);
  const settings = { signals: DRAWN.map((one) => ({ ...one, rate: RATE })), span: 60, layout: 'one' };
  await page.addInitScript((text) => localStorage.setItem('motorlink.plots', text), JSON.stringify(settings));
  await page.goto(fleet.url);
  await expect(page.getByRole('article')).toHaveCount(36, { timeout: MINUTE });
  return page;
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

/** One window holds a motor, and the one that draws turns another motor. Ends the recording of the page at FILL. */
async function soak(page: Page, holder: Page, fleet: Fleet): Promise<Cell[][]> {
  for (const one of [page, holder]) await one.evaluate(() => probing.end());
  const motor = card(holder, 'st0/1');
  await motor.getByRole('switch', { name: 'Hold to run' }).check();
  await motor.getByRole('spinbutton', { name: 'Target, rpm' }).fill(String(RPM));
  const hold = async () => {
    await motor.getByRole('button', { name: 'Hold to run' }).focus();
    await holder.keyboard.down('h');
  };
  const turn = async () => {
    await open(page, 'Motors');
    await spin(page, RPM, 'st1/1');
    await open(page, 'Plots');
  };
  const speeds = async () => [await fleet.speedAt(0, 1), await fleet.speedAt(1, 1)] as const;
  await hold();
  await turn();
  await expect.poll(async () => Math.min(...(await speeds())), { timeout: MINUTE }).toBeGreaterThan(RPM / 2);

  const session = await page.context().newCDPSession(page);
  const samples: { minute: number; sizes: number[] }[] = [];
  let stops = 0;
  const stalls = new Stalls();
  let isRecording = true;
  const began = performance.now();
  for (let next = began; next <= began + (FILL + MINUTES) * MINUTE; next += SAMPLE) {
    await pause(next - performance.now());
    if (isRecording && next >= began + FILL * MINUTE) {
      await endOwn(page);
      isRecording = false;
    }
    const [held, turned] = await speeds();
    const standing = [held, turned].filter((speed) => speed < RPM / 2).length;
    if (standing > 0) {
      stops += standing;
      const told = fleet.monitor.lines.filter(({ line, event }) => String(line).startsWith('st') || event === 'left');
      console.log(`a motor stands: ${held.toFixed(0)} and ${turned.toFixed(0)} rpm`, stalls.found.slice(-3), ...told.slice(-6).map(({ message }) => message));
      // What fails now is done again after the next look.
      if (held < RPM / 2) await holder.keyboard.up('h').then(hold).catch(console.log);
      if (turned < RPM / 2) await turn().catch(console.log);
    }
    const { objects, arrays } = await heap(session);
    const processes = await Promise.all([page, holder].map((one) => ofRenderers(one.context().browser()!)));
    const sizes = [resident(fleet.monitor.process.pid!), ...processes, objects, arrays];
    const minute = (performance.now() - began) / MINUTE;
    samples.push({ minute, sizes });
    console.log(row([`${minute.toFixed(1)} min`, ...sizes.map((bytes) => `${(bytes / MB).toFixed(1)} MB`)]));
  }
  await holder.keyboard.up('h');
  const stalled = await stalls.end();

  const names = [
    'server', 'process of the page that draws', 'process of the page that holds', 'JavaScript: objects', 'JavaScript: samples',
  ];
  const growth = (index: number, since: number, until: number) => {
    const part = samples.filter(({ minute }) => minute >= since && minute < until);
    const sizes = part.map((sample) => sample.sizes[index]! / MB);
    const day = slope(part.map(({ minute }, at) => [minute / 60 / 24, sizes[at]!] as const));
    return `${sizes[0]!.toFixed(0)} to ${sizes.at(-1)!.toFixed(0)} MB, ${day.growth.toFixed(0)} ± ${day.error.toFixed(0)} MB`;
  };
  return [
    ['motors that were found standing', stops, '0'],
    [`- stalls of the computer above ${STALL} ms, longest`, `${stalled.length}, ${Math.max(0, ...stalled).toFixed(0)} ms`, ''],
    ...names.map((name, index) => [`${name}: memory, growth in 24 h`, growth(index, FILL, Infinity), 'none']),
    ...(FILL > 0 ? [['server that records: memory, growth in 24 h', growth(0, FILL / 2, FILL), 'the index of the file']] : []),
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
  const browser = await launch();
  // A browser draws one of its pages only.
  const other = await launch();
  try {
    await fleet.plug();
    fleet.turn('rmd0');
    const page = await visit(browser, fleet);
    await recording(page).getByRole('button', { name: '● Record' }).click();
    await expect(recording(page)).toContainText(/REC \d\d:0[1-9]/, { timeout: MINUTE });
    await fleet.record();
    await open(page, 'Plots');
    await expect(number(page, HIGH)).toHaveText(/^\d+$/, { timeout: MINUTE });
    add(await measure(page, fleet));
    if (MINUTES > 0) add(await soak(page, await visit(other, fleet), fleet));
    else await endOwn(page);
    add(await recorded(fleet));
    const size = execFileSync('npm', ['run', '--silent', 'size']).toString().trim();
    add([['the page', size.replace('the page: ', ''), '< 200 kB']]);
    publish('view', table(['what', 'measured', 'goal'], rows, 3));
  } finally {
    await Promise.all([browser.close(), other.close()]);
    await fleet.end();
  }
});
