import { beforeEach, describe, expect, it, vi } from 'vitest';
import type { Rows } from '../link';
import type { SignalName } from '../wire';
import { BREAK, BYTES } from './samples';
import { type Curve, LONGEST, type Source, Store, type Wanted } from './store';
import { styleOf } from './style';

const WALL = 1_800_000_000;

/** What the page would get, by hand. */
class Share implements Source {
  subscriptions: { signals: SignalName[]; period: number; onRows: (rows: Rows) => void; refuse: (why: Error) => void }[] = [];
  wall = WALL;
  now = 0;
  subscribe: Source['subscribe'] = (signals, period, onRows, { onRefused }) => {
    const one = { signals, period, onRows, refuse: onRefused };
    this.subscriptions.push(one);
    return () => (this.subscriptions = this.subscriptions.filter((other) => other !== one));
  };
  wallAt = (_: string, t: number) => this.wall + t;
  wallNow = () => this.wall + this.now;
  send(t0: number, values: Record<string, number[]>, { period = 0.01, lost = 0, motor = 1, span = 0.001, to = 0 } = {}) {
    const columns = Object.keys(values).map((name) => ({ name, unit: '' }));
    const count = Object.values(values)[0]!.length;
    this.subscriptions[to]!.onRows({
      line: 'st0', motor, columns, t0, lost,
      t: Float64Array.from({ length: count }, (_, index) => index * period),
      span: new Float64Array(count).fill(span),
      values: Object.values(values).map((column) => Float64Array.from(column)),
    });
  }
}

const wanted = (name: string, rate = 100, motor = 1): Wanted => ({ line: 'st0', motor, name, unit: 'rpm', rate });
const ramp = (count: number) => Array.from({ length: count }, (_, index) => index);
const drawn = ({ samples }: Curve) => {
  const all: [number, number][] = [];
  for (let number = samples.first; number < samples.end; number += 1) all.push([samples.x(number), samples.y(number)]);
  return all;
};
const breaks = (curve: Curve) => drawn(curve).filter(([, y]) => y === BREAK).length;

let share: Share;
let store: Store;
const set = (...signals: Wanted[]) => store.set(signals, () => styleOf(0));

beforeEach(() => {
  share = new Share();
  store = new Store(share, WALL - 100);
});

describe('samples', () => {
  it('have the time of the wall clock, and lead back to the line', () => {
    set(wanted('SPEED'));
    share.send(5, { SPEED: [1, 2] });
    expect(drawn(store.curves[0]!)).toEqual([[105, 1], [105.01, 2]]);
    expect(store.lineTime('st0', 105.01)).toBeCloseTo(5.01, 9);
  });

  it('go to the curve of their motor and name', () => {
    set(wanted('SPEED'), wanted('SPEED', 100, 2), wanted('CURRENT'));
    share.send(0, { CURRENT: [1], SPEED: [2] });
    share.send(0, { SPEED: [3] }, { motor: 2 });
    expect(store.curves.map((curve) => drawn(curve)[0]![1])).toEqual([2, 3, 1]);
  });

  it('before the clock of the line is known are left out', () => {
    set(wanted('SPEED'));
    share.wallAt = () => NaN;
    share.send(0, { SPEED: [1] });
    expect(store.curves[0]!.samples.end).toBe(0);
  });
});

describe('subscriptions', () => {
  it('are one for each rate', () => {
    set(wanted('A', 100), wanted('B', 20), wanted('C', 100));
    expect(share.subscriptions.map(({ period, signals }) => [period, signals.map(({ name }) => name)])).toEqual([
      [0.01, ['A', 'C']],
      [0.05, ['B']],
    ]);
  });

  it('are not renewed without a reason', () => {
    set(wanted('A'), wanted('B', 20));
    const before = share.subscriptions;
    set(wanted('A'), wanted('B', 20));
    expect(share.subscriptions).toBe(before);
  });

  it('overlap, so that a signal that joins makes no hole and nothing is there twice', () => {
    set(wanted('A'));
    share.send(0, { A: ramp(10) });
    set(wanted('A'), wanted('B'));
    expect(share.subscriptions).toHaveLength(2);
    share.send(0.1, { A: ramp(5) });
    share.send(0.12, { A: ramp(10), B: ramp(10) }, { to: 1 });
    expect(share.subscriptions).toHaveLength(1);
    const times = drawn(store.curves[0]!).map(([x]) => Math.round((x - 100) * 100));
    expect(times).toEqual(ramp(22));
  });

  it('of a rate that nobody wants end', () => {
    set(wanted('A', 100), wanted('B', 20));
    set(wanted('B', 20));
    expect(share.subscriptions.map(({ period }) => period)).toEqual([0.05]);
    set();
    expect(share.subscriptions).toEqual([]);
  });

  it('keep the samples of signals that stay', () => {
    set(wanted('A'));
    share.send(0, { A: ramp(10) });
    set(wanted('A', 20));
    expect(store.curves[0]!.samples.end).toBe(10);
  });

  it('that are refused say why at their curves', () => {
    set(wanted('A'), wanted('B', 20));
    share.subscriptions[0]!.refuse(new Error('no such signal'));
    expect(store.curves.map(({ refused }) => refused)).toEqual(['no such signal', '']);
    share.send(0, { A: [1] });
    expect(store.curves[0]!.refused).toBe('');
  });
});

describe('a gap', () => {
  const curve = () => store.curves[0]!;
  beforeEach(() => set(wanted('A'), wanted('B')));

  it('is where records were lost', () => {
    share.send(0, { A: ramp(10) });
    share.send(0.11, { A: ramp(10) }, { lost: 1 });
    expect(breaks(curve())).toBe(1);
    expect(store.lost).toBe(1);
  });

  it('is in other groups of the subscription, too, if a value is missing there', () => {
    share.send(0, { A: ramp(10) });
    share.send(0, { B: ramp(10) });
    share.send(0.1, { A: ramp(10) }, { lost: 2 });
    share.send(0.12, { B: ramp(10) });
    expect(store.curves.map(breaks)).toEqual([1, 1]);
  });

  it('is where nothing was read for a while', () => {
    share.send(0, { A: ramp(10) });
    share.send(5, { A: ramp(10) });
    expect(breaks(curve())).toBe(1);
  });

  it('is not where a busy line is a bit late, or slower than asked', () => {
    share.send(0, { A: ramp(10) });
    share.send(0.14, { A: ramp(10) });
    share.send(0.24, { A: ramp(200) }, { period: 0.09 });
    expect(breaks(curve())).toBe(0);
  });

  it('is where a line was lost', () => {
    share.send(0, { A: ramp(10) });
    store.interrupt('st0', 2);
    share.send(0.1, { A: ramp(10) });
    expect(breaks(curve())).toBe(0);
    store.interrupt('st0');
    share.send(0.2, { A: ramp(10) });
    expect(breaks(curve())).toBe(1);
  });

  it('is what has no value', () => {
    share.send(0, { A: [1, NaN, Infinity, 4] });
    expect(drawn(curve()).map(([, y]) => y)).toEqual([1, NaN, NaN, 4]);
  });
});

describe('doubtful values', () => {
  beforeEach(() => set(wanted('A'), wanted('A', 100, 2)));

  it('are left out, those that were received and those that come later', () => {
    share.send(0, { A: ramp(10) });
    share.send(0, { A: ramp(10) }, { motor: 2 });
    store.doubt('st0', 1, 0.055, 0.125);
    share.send(0.1, { A: ramp(10) });
    const [first, second] = store.curves;
    expect(drawn(first!).filter(([, y]) => isNaN(y)).map(([x]) => Math.round((x - 100) * 100))).toEqual([6, 7, 8, 9, 10, 11, 12]);
    expect(first!.doubtful).toBe(7);
    expect(second!.doubtful).toBe(0);
  });

  it('are those whose reply came after the doubt, even if their time is before it', () => {
    share.send(0, { A: ramp(10) }, { span: 0.02 });
    store.doubt('st0', 1, 0.055, 0.12);
    expect(store.curves[0]!.doubtful).toBe(5);
  });
});

it('leaves the latest values out if events were lost, which may have been doubts', () => {
  set(wanted('A'), wanted('A', 100, 2));
  share.send(0, { A: ramp(1000) });
  share.send(0, { A: ramp(1000) }, { motor: 2 });
  share.now = 10;
  store.doubtAll();
  for (const { doubtful, samples } of store.curves) {
    expect(doubtful).toBeGreaterThanOrEqual(500);
    expect(samples.extremes(0, 499)).toEqual({ min: 0, max: 498 });
  }
});

describe('a clock that was set', () => {
  beforeEach(() => set(wanted('A')));

  it('of a line begins a new part of the curve', () => {
    share.send(100, { A: ramp(10) });
    share.wall += 101;
    share.send(0, { A: ramp(10) });
    const [curve] = store.curves;
    expect(breaks(curve!)).toBe(1);
    expect(curve!.samples.newest).toBeCloseTo(100 + 101 + 0.09, 6);
    expect(store.lineTime('st0', curve!.samples.newest)).toBeCloseTo(0.09, 6);
    // Earlier samples keep the time that the line had then, for the wire at a cursor and for CSV.
    expect(store.lineTime('st0', curve!.samples.oldest)).toBeCloseTo(100, 6);
    expect(store.lineTime('st0', curve!.samples.oldest - 5)).toBeCloseTo(95, 6);
  });

  it('back and forth leads to the time of the line that the samples have', () => {
    share.send(100, { A: [1] });
    for (const [t, by] of [[101, -50], [102, 80], [103, -90]] as const) {
      share.wall += by;
      share.send(t, { A: ramp(2) });
    }
    const { samples } = store.curves[0]!;
    expect(store.lineTime('st0', samples.newest)).toBeCloseTo(103.01, 6);
    expect(store.lineTime('st0', samples.oldest)).toBeCloseTo(103, 6);
  });

  it('back forgets what would lie in the future', () => {
    share.send(100, { A: ramp(10) });
    share.wall -= 50;
    share.send(101, { A: ramp(10) });
    expect(drawn(store.curves[0]!)).toHaveLength(10);
  });

  it('a little does not shift the curve', () => {
    share.send(0, { A: ramp(10) });
    share.wall += 0.01;
    share.send(0.1, { A: ramp(10) });
    expect(store.curves[0]!.samples.newest).toBeCloseTo(100.19, 9);
  });
});

describe('memory', () => {
  it('is for ten minutes', () => {
    set(...ramp(40).map((index) => wanted(`S${index}`)));
    expect(store.kept).toBe(LONGEST);
  });

  it('has a bound, and the time that is kept is less then', () => {
    set(...ramp(40).map((index) => wanted(`S${index}`, 1000)));
    expect(store.kept).toBeGreaterThan(150);
    expect(40 * 1000 * store.kept * BYTES).toBeLessThanOrEqual(128 * 2 ** 20);
  });
});

it('knows which values are old', () => {
  set(wanted('A'));
  const [curve] = store.curves;
  store.look(curve!);
  expect(curve!.old).toBe(true);
  share.send(0, { A: [1] });
  for (const [now, isOld] of [[0.5, false], [1.1, true], [NaN, true]] as const) {
    share.now = now;
    store.look(curve!);
    expect(curve!.old).toBe(isOld);
  }
});

it('ends an old subscription if the new one gives nothing', () => {
  vi.useFakeTimers();
  set(wanted('A'));
  set(wanted('A'), wanted('B'));
  vi.advanceTimersByTime(5000);
  vi.useRealTimers();
  expect(share.subscriptions).toHaveLength(1);
});
