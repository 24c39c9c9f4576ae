// What a recorded step response says: rise, delay, overshoot, settling, steady error.
// A number that the data do not carry is refused, with the reason.

/** A recorded response. */
export interface Recording {
  /** Times of the samples, in seconds, ascending. The spacing may vary. */
  t: ArrayLike<number>;
  /** The measured values. NaN is no value. */
  y: ArrayLike<number>;
  /** When the reference changed: the earliest and the latest possible time. */
  at: [number, number];
  /** The reference before and after the step. */
  from: number;
  to: number;
  /** The step between two measured values of the drive; 0 if it is not known. */
  resolution: number;
}

/** A number with its uncertainty, an upper bound, or the reason why there is neither. */
export type Figure =
  | { kind: 'value'; value: number; error: number }
  | { kind: 'below'; bound: number; why: string }
  | { kind: 'none'; why: string };

export type FigureName = 'delay' | 'rise' | 'overshoot' | 'settling5' | 'settling2' | 'steadyError';

export interface Analysis {
  figures: Record<FigureName, Figure>;
  /** The measured value before the step and at the end of the record. NaN: too few samples. */
  initial: number;
  final: number;
  /** Standard deviation of the noise. */
  noise: number;
  /** The step between two measured values: that of the drive, or a larger one that was seen. */
  resolution: number;
  /** Samples after the step, and the mean and longest time between two samples, in seconds. */
  samples: number;
  interval: number;
  longest: number;
  /** Time between two new values, in seconds: a drive may repeat a value. */
  update: number;
  /** What makes the numbers mean something else than usual. */
  remarks: string[];
}

/** The definitions that are used, for the page and for exports. */
export const DEFINITIONS: Record<FigureName, { name: string; unit: string; doc: string }> = {
  delay: { name: 'Delay', unit: 's', doc: 'From the step until the value has gone 50 % of its way.' },
  rise: { name: 'Rise time', unit: 's', doc: 'From 10 % to 90 % of the way.' },
  overshoot: { name: 'Overshoot', unit: '%', doc: 'Highest value beyond the final value, in % of the way.' },
  settling5: {
    name: 'Settling time, 5 %', unit: 's',
    doc: 'From the step until the value stays within 5 % of the way around the final value.',
  },
  settling2: {
    name: 'Settling time, 2 %', unit: 's',
    doc: 'From the step until the value stays within 2 % of the way around the final value.',
  },
  steadyError: { name: 'Steady-state error', unit: '', doc: 'Reference minus final value.' },
};
export const WAY =
  'The way is from the mean before the step to the final value. The final value is the mean of the last fifth of the record.';

/** The part of the record after the step that gives the final value. */
const END = 0.2;
const LEAST_BEFORE = 5;
const LEAST_END = 8;
/** Below this many standard deviations, a difference is noise. */
const SIGMAS = 4;
/** Fewer different values may have a common step by chance. */
const LEAST_STEPS = 8;
/** Times between samples that are so many times the mean are gaps. */
const GAP = 4;
/** A straight line is met to this part of the rise time. */
const STRAIGHT = 0.03;
/** A smaller overshoot, as a part of the way, is not told from none. */
const LEAST_OVERSHOOT = 0.001;

export function analyse(recording: Recording): Analysis {
  const { t, y } = valid(recording);
  const [earliest, latest] = recording.at;
  const first = t.findIndex((time) => time > latest);
  const before = y.filter((_, index) => t[index]! < earliest);
  const times = first < 0 ? [] : t.slice(first);
  const values = first < 0 ? [] : y.slice(first);
  const gaps = differences(times);
  const resolution = Math.max(recording.resolution, commonStep(y));
  const analysis: Analysis = {
    figures: none('There are too few samples.'),
    initial: mean(before),
    final: NaN,
    noise: NaN,
    resolution,
    samples: times.length,
    interval: mean(gaps),
    longest: highest(gaps),
    update: NaN,
    remarks: [],
  };
  if (before.length < LEAST_BEFORE) {
    const had = `There are ${before.length} samples before the step; ${LEAST_BEFORE} are needed.`;
    return { ...analysis, figures: none(had) };
  }
  const end = times.at(-1) ?? latest;
  const endFrom = end - END * (end - latest);
  const tail = values.filter((_, index) => times[index]! >= endFrom);
  if (tail.length < LEAST_END) {
    const had = `There are ${tail.length} samples in the last fifth of the record; ${LEAST_END} are needed.`;
    return { ...analysis, figures: none(had) };
  }
  const final = mean(tail);
  const noise = Math.max(deviation(before), scatter(tail));
  Object.assign(analysis, { final, noise });

  const way = final - analysis.initial;
  const commanded = recording.to - recording.from;
  const blur = SIGMAS * noise + resolution;
  if (Math.abs(way) <= blur) {
    const why =
      Math.abs(commanded) <= blur
        ? `The step of ${plain(Math.abs(commanded))} is smaller than noise and resolution (${plain(blur)}).`
        : `The value did not follow: it changed by ${plain(way)}, which is less than noise and resolution (${plain(blur)}).`;
    return { ...analysis, figures: none(why) };
  }
  if (way * commanded < 0) {
    return { ...analysis, figures: none('The value went in the opposite direction.') };
  }
  const unsettled = whyUnsettled(tail, Math.abs(way), noise, resolution);
  if (unsettled) return { ...analysis, figures: none(unsettled) };

  // The last sample before the step is where the response begins.
  const begin = Math.max(0, t.findLastIndex((time) => time < earliest));
  const scaled: Scaled = {
    t: t.slice(begin),
    x: y.slice(begin).map((value) => (value - analysis.initial) / way),
    at: (earliest + latest) / 2,
    doubt: (latest - earliest) / 2,
    endFrom,
    blur: blur / Math.abs(way),
    noise: noise / Math.abs(way),
    resolution: resolution / Math.abs(way),
    mean: analysis.interval,
    update: NaN,
  };
  scaled.update = analysis.update = updateInterval(scaled);
  const error = recording.to - final;
  analysis.figures = {
    delay: delay(scaled),
    rise: rise(scaled),
    overshoot: overshoot(scaled),
    settling5: settling(scaled, 0.05),
    settling2: settling(scaled, 0.02),
    steadyError: {
      kind: 'value',
      value: error,
      error: (2 * noise) / Math.sqrt(tail.length) + resolution / 2,
    },
  };
  const gap = latest - earliest;
  if (Math.abs(error) > 0.05 * Math.abs(commanded) + blur) {
    analysis.remarks.push(
      'The value does not reach the reference. Something limits it (current, voltage, load), or the regulator has no integral part.',
    );
  }
  if (Math.abs(analysis.initial - recording.from) > 0.05 * Math.abs(commanded) + blur) {
    analysis.remarks.push('The value was not at the start of the step when the step began.');
  }
  if (isStraight(scaled)) {
    analysis.remarks.push(
      'The value rises in a straight line. A ramp or a limit of the current sets the rise time, not the gains.',
    );
  }
  if (analysis.longest > GAP * analysis.interval) {
    analysis.remarks.push(`A gap of ${milliseconds(analysis.longest)} is in the record.`);
  }
  if (gap > 2 * analysis.interval) {
    analysis.remarks.push(`The time of the step is known to ±${milliseconds(gap / 2)} only.`);
  }
  return analysis;
}

/** The response from 0 (before the step) to 1 (final value). */
interface Scaled {
  t: number[];
  x: number[];
  at: number;
  doubt: number;
  endFrom: number;
  blur: number;
  noise: number;
  resolution: number;
  update: number;
  /** The mean time between two samples. */
  mean: number;
}

/** When the response has reached a level, between two samples. */
interface Crossing {
  t: number;
  /** Index of the first sample behind it. */
  index: number;
  error: number;
}

function crossing(scaled: Scaled, index: number, level: number): Crossing {
  const { t, x } = scaled;
  const [t0, t1, x0, x1] = [t[index - 1]!, t[index]!, x[index - 1]!, x[index]!];
  const gap = t1 - t0;
  const at = x1 === x0 ? t1 : t0 + (gap * (level - x0)) / (x1 - x0);
  // Noise and quantisation move a crossing the more, the slower the value changes.
  const slope = slopeAround(scaled, index);
  const blurred = slope > 0 ? (scaled.noise + scaled.resolution) / slope : 0;
  return { t: at, index, error: Math.max(gap, scaled.update || 0) / 2 + blurred };
}

/** Mean slope over the samples around an index, over at least the blur. */
function slopeAround({ t, x, blur }: Scaled, index: number): number {
  let [low, high] = [index - 1, index];
  while (Math.abs(x[high]! - x[low]!) < blur && (low > 0 || high < x.length - 1)) {
    low = Math.max(0, low - 1);
    high = Math.min(x.length - 1, high + 1);
  }
  return Math.abs(x[high]! - x[low]!) / (t[high]! - t[low]!);
}

/** The 90 % crossing is the first; that of a lower level is the last before it: noise may cross it early. */
function up(scaled: Scaled, level: number): Crossing | null {
  const top = scaled.x.findIndex((value, index) => index > 0 && value >= 0.9);
  if (top < 0) return null;
  if (level >= 0.9) return crossing(scaled, top, level);
  for (let index = top; index > 0; index -= 1) {
    if (scaled.x[index - 1]! < level) return crossing(scaled, index, level);
  }
  return null;
}

function delay(scaled: Scaled): Figure {
  const half = up(scaled, 0.5);
  if (!half) return { kind: 'none', why: 'The value was beyond 50 % before the step.' };
  const value = half.t - scaled.at;
  const error = half.error + scaled.doubt;
  if (value <= error) {
    return { kind: 'below', bound: value + error, why: 'It is shorter than the time between two samples.' };
  }
  return { kind: 'value', value, error };
}

function rise(scaled: Scaled): Figure {
  if (scaled.blur > 0.2) {
    return { kind: 'none', why: `The noise (${percent(scaled.noise)} of the way) hides 10 % and 90 %.` };
  }
  const [low, high] = [up(scaled, 0.1), up(scaled, 0.9)];
  if (!low || !high) return { kind: 'none', why: 'The value was beyond 10 % before the step.' };
  const value = high.t - low.t;
  const between = high.index - low.index;
  const error = Math.hypot(low.error, high.error);
  if (between < 2) {
    const bound = scaled.t[high.index]! - scaled.t[low.index - 1]!;
    return { kind: 'below', bound, why: 'Fewer than two samples are between 10 % and 90 %.' };
  }
  if (value <= error) {
    return { kind: 'below', bound: value + error, why: 'It is shorter than its uncertainty.' };
  }
  return { kind: 'value', value, error };
}

function overshoot(scaled: Scaled): Figure {
  const { x, noise, resolution } = scaled;
  const index = x.reduce((best, value, at) => (value > x[best]! ? at : best), 0);
  const over = x[index]! - 1;
  // The highest of many samples is too high by noise.
  const bound = Math.max((SIGMAS - 1) * noise + resolution, LEAST_OVERSHOOT);
  const missed = Math.max(0, highestBetween(scaled) - x[index]!);
  if (over <= bound) {
    return { kind: 'below', bound: 100 * (bound + missed), why: 'None is larger than noise and resolution.' };
  }
  const [left, right] = [x[index - 1] ?? x[index]!, x[index + 1] ?? x[index]!];
  const curvature = Math.abs(left - 2 * x[index]! + right) / 8;
  if (missed > over / 2) {
    return { kind: 'none', why: `The highest value may be in a gap of the samples: ${percent(over)} or more.` };
  }
  return { kind: 'value', value: 100 * over, error: 100 * (2 * noise + resolution + Math.max(curvature, missed)) };
}

/** The most that the response can reach between two samples: where the lines before and after meet. */
function highestBetween({ t, x, mean: interval }: Scaled): number {
  let most = -Infinity;
  for (let index = 1; index < t.length; index += 1) {
    const gap = t[index]! - t[index - 1]!;
    if (gap <= GAP * interval || Math.max(x[index]!, x[index - 1]!) < 1) continue;
    const before = t.findLastIndex((time) => time <= t[index - 1]! - gap);
    const after = t.findIndex((time) => time >= t[index]! + gap);
    if (before < 0 || after < 0) continue;
    const up = (x[index - 1]! - x[before]!) / (t[index - 1]! - t[before]!);
    const down = (x[index]! - x[after]!) / (t[after]! - t[index]!);
    if (up <= 0 || down <= 0) continue;
    // The time after the first of the two samples at which both lines meet.
    const at = (x[index]! + down * gap - x[index - 1]!) / (up + down);
    if (at > 0 && at < gap) most = Math.max(most, x[index - 1]! + up * at);
  }
  return most;
}

function settling(scaled: Scaled, band: number): Figure {
  const { t, x } = scaled;
  const swing = highest(x.filter((_, index) => t[index]! >= scaled.endFrom).map((value) => Math.abs(value - 1)));
  if (swing > 0.8 * band) {
    return { kind: 'none', why: `The value varies by ±${percent(swing)} of the way in the last fifth, which fills the band.` };
  }
  const last = x.findLastIndex((value) => Math.abs(value - 1) > band);
  const outside = x[last];
  if (outside === undefined || last + 1 >= x.length || t[last + 1]! >= scaled.endFrom) {
    return { kind: 'none', why: 'It has not settled before the last fifth of the record. Record longer.' };
  }
  const settled = crossing(scaled, last + 1, outside > 1 ? 1 + band : 1 - band);
  const value = settled.t - scaled.at;
  const error = settled.error + scaled.doubt;
  if (value <= error) {
    return { kind: 'below', bound: value + error, why: 'It is shorter than the time between two samples.' };
  }
  return { kind: 'value', value, error };
}

/** Why the end of the record is not steady; `null` if it is. */
function whyUnsettled(tail: number[], way: number, noise: number, resolution: number): string | null {
  const half = Math.floor(tail.length / 2);
  const drift = mean(tail.slice(half)) - mean(tail.slice(0, half));
  const blurred = (SIGMAS * noise) / Math.sqrt(half) + resolution;
  if (Math.abs(drift) > 0.01 * way + blurred) {
    return `It has not settled: the value still changes by ${percent(Math.abs(drift) / way)} of the way in the last fifth. Record longer.`;
  }
  const swing = (highest(tail) + highest(tail.map((value) => -value))) / 2;
  if (swing > 0.02 * way + SIGMAS * noise + resolution) {
    return `It has not settled: the value still swings by ±${percent(swing / way)} of the way in the last fifth.`;
  }
  return null;
}

/**
 * Whether the response is a straight line with a sharp beginning, as a limited rate gives. A response of
 * second order is nearly straight between 10 % and 90 %, but begins slowly.
 */
function isStraight(scaled: Scaled): boolean {
  const levels = [0.03, 0.1, 0.3, 0.5, 0.7, 0.9].map((level) => ({ level, at: up(scaled, level) }));
  const [foot, low, high] = [levels[0]!.at, levels[1]!.at, levels.at(-1)!.at];
  if (!foot || !low || !high) return false;
  const rise = high.t - low.t;
  return levels.every(({ level, at }) => {
    const line = low.t + (rise * (level - 0.1)) / 0.8;
    return at !== null && at.error < STRAIGHT * rise && Math.abs(at.t - line) < STRAIGHT * rise;
  });
}

function valid({ t, y }: Recording): { t: number[]; y: number[] } {
  const kept = Array.from(y, (_, index) => index).filter((index) => !Number.isNaN(y[index]));
  return { t: kept.map((index) => t[index]!), y: kept.map((index) => y[index]!) };
}

function none(why: string): Record<FigureName, Figure> {
  const figure: Figure = { kind: 'none', why };
  return {
    delay: figure, rise: figure, overshoot: figure, settling5: figure, settling2: figure, steadyError: figure,
  };
}

/** Noise from the differences of neighbours, which a slow swing does not enlarge. */
export function scatter(values: readonly number[]): number {
  const steps = differences(values);
  return steps.length ? Math.sqrt(mean(steps.map((step) => step * step)) / 2) : 0;
}

/** A step of which all differences of values are multiples: a drive may round more than its register. */
function commonStep(values: number[]): number {
  const sorted = [...new Set(values)].sort((a, b) => a - b);
  const steps = differences(sorted);
  if (steps.length < LEAST_STEPS) return 0;
  const least = -highest(steps.map((step) => -step));
  const isMultiple = (step: number) => Math.abs(step / least - Math.round(step / least)) < 0.02;
  return steps.every(isMultiple) ? least : 0;
}

/** Time between two new values while the response rises. */
function updateInterval({ t, x }: Scaled): number {
  const top = x.findIndex((value, index) => index > 0 && value >= 0.9);
  const changes = t.filter((_, index) => index > 0 && index <= top && x[index] !== x[index - 1]);
  return changes.length > 3 ? median(differences(changes)) : NaN;
}

/** Arrays can be longer than an argument list. */
function highest(values: readonly number[]): number {
  return values.reduce((most, value) => Math.max(most, value), -Infinity);
}

export function median(values: number[]): number {
  const sorted = [...values].sort((a, b) => a - b);
  const middle = sorted.length >> 1;
  if (!sorted.length) return NaN;
  return sorted.length % 2 ? sorted[middle]! : (sorted[middle - 1]! + sorted[middle]!) / 2;
}

export function mean(values: readonly number[]): number {
  return values.reduce((sum, value) => sum + value, 0) / values.length;
}

export function deviation(values: readonly number[]): number {
  const middle = mean(values);
  return Math.sqrt(mean(values.map((value) => (value - middle) ** 2)));
}

function differences(values: readonly number[]): number[] {
  return values.slice(1).map((value, index) => value - values[index]!);
}

function plain(value: number): string {
  return String(Number(value.toPrecision(3)));
}

function percent(share: number): string {
  return `${plain(100 * share)} %`;
}

function milliseconds(seconds: number): string {
  return `${plain(1000 * seconds)} ms`;
}
