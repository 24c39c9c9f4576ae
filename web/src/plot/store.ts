// The live signals: subscriptions grouped by rate, and the samples of each signal.
//
// Memory: 10 min at the asked rate, 18.2 bytes a sample. 40 signals at 100 Hz take 44 MB. All signals
// together get at most `MOST_BYTES`; beyond that each keeps a shorter time: 40 at 1 kHz keep 3 min.
// There is no worker: what is done here takes less than 1 % of a core at 4000 values a second.
// No sample goes through Preact: scheduler.ts draws.
import type { Rows } from '../link';
import type { SignalName } from '../wire';
import type { Trace } from './chart';
import { BREAK, BYTES, Samples } from './samples';
import type { Style } from './style';

export const LONGEST = 600;
const MOST_BYTES = 128 * 2 ** 20;
/** A step of time so many times the usual one is a gap, and so many after records were lost. */
const GAP = 4;
const GAP_AFTER_LOSS = 1.5;
/** Seconds. A shorter pause is not a gap unless records were lost: a line may be busy. */
const LEAST_GAP = 0.1;
/** A clock that differs by so many seconds was set again. */
const CLOCK_SET = 0.5;
/** An old subscription ends when the new one gives values, or after so many ms. */
const OVERLAP = 3000;
/** A value that is older, in seconds, is not a present one. */
const OLD = 1;
/** How far back doubts may reach that this page was not told of, in seconds. */
const UNTOLD = 5;

/** What the signals come from: link.ts, or a synthetic source. */
export interface Source {
  subscribe: (
    signals: SignalName[], period: number, onRows: (rows: Rows) => void,
    options: { onRefused: (why: Error) => void },
  ) => () => void;
  /** The wall clock at a time of a line's clock; NaN if it is unknown. */
  wallAt: (line: string, t: number) => number;
  wallNow: () => number;
}

export interface Wanted extends SignalName {
  unit: string;
  /** In Hz. */
  rate: number;
}

export function keyOf({ line, motor, name }: SignalName): string {
  return `${line}/${motor}/${name}`;
}

/** As the page writes it: `st0/1 SPEED_MEAS`. */
export function nameOf({ line, motor, name }: SignalName): string {
  return `${line}/${motor} ${name}`;
}

/** A live signal. Its times are in seconds after `origin`. */
export class Curve implements Trace {
  readonly key: string;
  readonly line: string;
  readonly motor: number;
  readonly signal: string;
  readonly name: string;
  readonly unit: string;
  readonly stepped = false;
  readonly samples = new Samples();
  rate: number;
  shown = true;
  old = true;
  /** Samples that are left out, since they may belong to other signals. */
  doubtful = 0;
  /** Why the share gives nothing. */
  refused = '';
  /** The usual time between two samples. */
  period: number;
  /** The longest time from request to reply, lately. */
  span = 0;
  /** A break comes before the next sample in any case, or if it is late. */
  breaks: 'no' | 'late' | 'yes' = 'no';

  constructor(wanted: Wanted, readonly style: Style) {
    this.key = keyOf(wanted);
    this.line = wanted.line;
    this.motor = wanted.motor;
    this.signal = wanted.name;
    this.name = nameOf(wanted);
    this.unit = wanted.unit;
    this.rate = wanted.rate;
    this.period = 1 / wanted.rate;
  }

  push(x: number, y: number) {
    const { samples } = this;
    const before = samples.newest;
    if (x <= before) {
      // The same sample from two subscriptions, or a clock that was set back.
      if (before - x < CLOCK_SET) return;
      samples.clear();
    } else if (!isNaN(before)) {
      const step = x - before;
      const limit = Math.max(GAP * this.period, LEAST_GAP);
      const broken =
        this.breaks === 'yes' || step > limit || (this.breaks === 'late' && step > GAP_AFTER_LOSS * this.period);
      if (broken) samples.push(before + step / 2, BREAK);
      this.period += 0.2 * (Math.min(step, 10 * this.period) - this.period);
    }
    this.breaks = 'no';
    samples.push(x, isFinite(y) ? y : NaN);
  }

  /** How old the newest value is, in seconds. */
  age(now: number): number {
    const newest = this.samples.newest;
    return isNaN(newest) ? NaN : now - newest;
  }
}

interface Subscription {
  names: string;
  end: () => void;
}

/** What is added to times of a line from this time of the curves on. */
interface Offset {
  from: number;
  offset: number;
}

interface Doubt {
  since: number;
  until: number;
}

export class Store {
  private known = new Map<string, Curve>();
  private readonly subscriptions = new Map<number, Subscription>();
  private readonly byColumns = new WeakMap<object, (Curve | undefined)[]>();
  /** Of each line, in the order of time: samples before a clock was set keep the offset that they got. */
  private readonly offsets = new Map<string, Offset[]>();
  private readonly doubts = new Map<string, Doubt>();
  /** Changes with the set of curves: groups look their curves up again. */
  private generation: object = {};
  private readonly generations = new WeakMap<object, object>();
  /** Records that this page was too slow for. */
  lost = 0;
  /** How much of the past is kept, in seconds. */
  kept = LONGEST;
  /** New samples. */
  onSamples = () => {};

  constructor(
    private readonly source: Source,
    /** Seconds since 1970 at time 0 of the curves. A whole number of hours. */
    readonly origin: number,
  ) {}

  get curves(): Curve[] {
    return [...this.known.values()];
  }

  /** The present time of the curves. */
  now(): number {
    return this.source.wallNow() - this.origin;
  }

  /** The time of a line's clock at `x`. */
  lineTime(line: string, x: number): number {
    return x - (this.offsets.get(line)?.findLast(({ from }) => from <= x)?.offset ?? NaN);
  }

  /** Reads these signals, and no others. Those that were read before keep their samples. */
  set(wanted: readonly Wanted[], style: (key: string) => Style) {
    const next = new Map<string, Curve>();
    for (const one of wanted) {
      const key = keyOf(one);
      const before = this.known.get(key);
      const curve = before?.unit === one.unit ? before : new Curve(one, style(key));
      if (curve.rate !== one.rate) {
        curve.rate = one.rate;
        curve.period = 1 / one.rate;
        curve.breaks = 'no';
      }
      next.set(key, curve);
    }
    this.known = next;
    this.generation = {};
    this.share();
    const rates = new Map<number, Curve[]>();
    for (const curve of next.values()) rates.set(curve.rate, [...(rates.get(curve.rate) ?? []), curve]);
    for (const [rate, subscription] of this.subscriptions) {
      if (rates.has(rate)) continue;
      subscription.end();
      this.subscriptions.delete(rate);
    }
    for (const [rate, curves] of rates) this.subscribe(rate, curves);
  }

  /** Divides the memory. */
  private share() {
    const curves = this.curves;
    const wanted = curves.reduce((sum, { rate }) => sum + LONGEST * rate * BYTES, 0);
    const part = Math.min(1, MOST_BYTES / wanted);
    this.kept = LONGEST * part;
    for (const { samples, rate } of curves) samples.resize(Math.ceil(LONGEST * part * rate));
  }

  private subscribe(rate: number, curves: Curve[]) {
    const before = this.subscriptions.get(rate);
    const names = curves.map(({ key }) => key).sort().join();
    if (before?.names === names) return;
    for (const curve of curves) curve.refused = '';
    let late: ReturnType<typeof setTimeout> | undefined;
    const over = () => {
      clearTimeout(late);
      late = undefined;
      before?.end();
    };
    // Without a hole: the old one ends when this one gives values.
    if (before) late = setTimeout(over, OVERLAP);
    let ended = false;
    const end = this.source.subscribe(
      curves.map(({ line, motor, signal }) => ({ line, motor, name: signal })),
      1 / rate,
      (rows) => {
        if (late !== undefined) over();
        this.take(rows, curves);
      },
      {
        onRefused: ({ message }) => {
          if (!ended) for (const curve of curves) curve.refused = message;
          this.onSamples();
        },
      },
    );
    this.subscriptions.set(rate, {
      names,
      end: () => {
        ended = true;
        if (late !== undefined) over();
        end();
      },
    });
  }

  private take(rows: Rows, subscribed: readonly Curve[]) {
    const { line, motor, columns, t0, t, span, values, lost } = rows;
    if (lost > 0) {
      this.lost += lost;
      // It is not known of which signals of the subscription they were.
      for (const curve of subscribed) curve.breaks = 'late';
    }
    const offset = this.offset(line, t0);
    if (isNaN(offset)) return;
    const doubt = this.doubts.get(`${line}/${motor}`);
    this.curvesOf(columns, line, motor).forEach((curve, column) => {
      if (!curve) return;
      curve.refused = '';
      if (lost > 0) curve.breaks = 'yes';
      const ys = values[column]!;
      for (let row = 0; row < t.length; row += 1) {
        const time = t0 + t[row]!;
        curve.span = Math.max(span[row]!, 0.99 * curve.span);
        const doubtful = doubt && time <= doubt.until && time + span[row]! / 2 > doubt.since;
        if (doubtful) curve.doubtful += 1;
        curve.push(time + offset, doubtful ? NaN : ys[row]!);
      }
    });
    this.onSamples();
  }

  private curvesOf(columns: Rows['columns'], line: string, motor: number): (Curve | undefined)[] {
    let curves = this.byColumns.get(columns);
    if (!curves || this.generations.get(columns) !== this.generation) {
      curves = columns.map(({ name }) => this.known.get(keyOf({ line, motor, name })));
      this.byColumns.set(columns, curves);
      this.generations.set(columns, this.generation);
    }
    return curves;
  }

  /** What is added to times of a line. It stays the same until the clock is set: curves do not tremble. */
  private offset(line: string, t: number): number {
    const now = this.source.wallAt(line, t) - t - this.origin;
    const known = this.offsets.get(line) ?? [];
    const before = known.at(-1)?.offset ?? NaN;
    if (isNaN(now) || Math.abs(now - before) < CLOCK_SET) return before;
    // A clock that was set back leaves no earlier samples after this time.
    const earlier = known.filter(({ from }) => from < t + now);
    this.offsets.set(line, [...earlier, { from: earlier.length ? t + now : -Infinity, offset: now }]);
    if (!isNaN(before)) this.interrupt(line);
    return now;
  }

  /** Values of a motor were not read for a time: a line was lost, a motor was silent, the page was cut off. */
  interrupt(line?: string, motor?: number) {
    for (const curve of this.known.values()) {
      if ((line ?? curve.line) === curve.line && (motor ?? curve.motor) === curve.motor) curve.breaks = 'yes';
    }
  }

  /** Values that ended after `since` may be those of other signals. Both are times of the line. */
  doubt(line: string, motor: number, since: number, until: number) {
    const key = `${line}/${motor}`;
    const before = this.doubts.get(key);
    const from = before && before.until >= since ? Math.min(before.since, since) : since;
    this.doubts.set(key, { since: from, until: Math.max(until, before?.until ?? until) });
    const offset = this.offsets.get(line)?.at(-1)?.offset;
    if (offset === undefined) return;
    for (const curve of this.known.values()) {
      if (curve.line !== line || curve.motor !== motor) continue;
      curve.doubtful += curve.samples.blank(since + offset - curve.span / 2);
    }
    this.onSamples();
  }

  /** Events were lost: any of the latest values may be doubtful. */
  doubtAll() {
    for (const { line, motor } of this.known.values()) {
      const now = this.lineTime(line, this.now());
      this.doubt(line, motor, now - UNTOLD, now);
    }
  }

  /** Whether the newest value of a curve is too old to be taken for the present one. Returns its age. */
  look(curve: Curve): number {
    const age = curve.age(this.now());
    curve.old = !(age <= OLD);
    return age;
  }
}
