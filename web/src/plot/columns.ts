// What a curve needs to be drawn at a width: for each column of the screen the least and the most value
// of its samples. The columns lie on a grid of time that does not move with the view: a column that is
// complete never changes, so scrolling computes only the new ones, and nothing flickers.
import { type Extremes, type Samples } from './samples';

/** Columns that begin at `from * width`, in seconds. */
export class Columns {
  /** The width of a column in seconds. */
  width = 0;
  private size = 0;
  private version = -1;
  private tag = new Float64Array(0);
  private complete = new Uint8Array(0);
  private next = new Float64Array(0);
  private readonly found: Extremes = { min: 0, max: 0 };
  /** The values of column `k` are at `k % size`, see `slot`. */
  min = new Float64Array(0);
  max = new Float64Array(0);
  /** Whether the column has a sample with a value, and where the curve is interrupted. */
  has = new Uint8Array(0);
  broken = new Uint8Array(0);

  slot(k: number): number {
    return ((k % this.size) + this.size) % this.size;
  }

  /** Computes the columns `from` to `to`, inclusive, as far as they are not known. */
  update(samples: Samples, width: number, from: number, to: number) {
    this.fit(samples, width, to - from + 1);
    const newest = samples.newest;
    let number = -1;
    for (let k = from; k <= to; k += 1) {
      const slot = this.slot(k);
      if (this.tag[slot] === k && this.complete[slot]) {
        number = this.next[slot]!;
        continue;
      }
      const start = number < 0 ? samples.at(k * width) : Math.max(number, samples.first);
      const limit = (k + 1) * width;
      let end = start;
      if (start < samples.end && samples.x(start) < limit) end = endOf(samples, start, limit);
      this.compute(samples, slot, start, end);
      this.tag[slot] = k;
      this.complete[slot] = newest >= limit ? 1 : 0;
      this.next[slot] = end;
      number = end;
    }
  }

  private fit(samples: Samples, width: number, count: number) {
    if (width === this.width && samples.version === this.version && count <= this.size) return;
    this.width = width;
    this.version = samples.version;
    if (count > this.size) {
      this.size = count + 64;
      const floats = () => new Float64Array(this.size);
      this.tag = floats();
      this.next = floats();
      this.min = floats();
      this.max = floats();
      this.complete = new Uint8Array(this.size);
      this.has = new Uint8Array(this.size);
      this.broken = new Uint8Array(this.size);
    }
    this.tag.fill(NaN);
  }

  private compute(samples: Samples, slot: number, start: number, end: number) {
    samples.extremes(start, end, this.found);
    this.min[slot] = this.found.min;
    this.max[slot] = this.found.max;
    this.has[slot] = this.found.min <= this.found.max ? 1 : 0;
    const first = start < end ? samples.y(start) : 0;
    const last = start < end ? samples.y(end - 1) : 0;
    this.broken[slot] = (isFinite(first) ? 0 : BROKEN_BEFORE) | (isFinite(last) ? 0 : BROKEN_AFTER);
  }
}

/** The curve does not reach this column from the left, or leave it to the right. */
export const BROKEN_BEFORE = 1;
export const BROKEN_AFTER = 2;

/** The first sample from `start` on that is at `limit` or later: near `start`, mostly. */
function endOf(samples: Samples, start: number, limit: number): number {
  let step = 1;
  let low = start;
  while (low + step < samples.end && samples.x(low + step) < limit) {
    low += step;
    step *= 2;
  }
  let high = Math.min(low + step, samples.end);
  low += 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (samples.x(middle) < limit) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** What draws: screen coordinates of a canvas, or a recorder in a test. */
export interface Pen {
  moveTo(x: number, y: number): void;
  lineTo(x: number, y: number): void;
}

/** How values become places on the screen, and when the pen is lifted. */
export interface Frame {
  x: (time: number) => number;
  y: (value: number) => number;
  /** The pattern by column: length of a period and of the part that is drawn. `[0, 0]` is a solid line. */
  dash: readonly number[];
  /** Each value holds until the next one. */
  stepped: boolean;
}

/** In pixels. A column of less height is a point. */
const FLAT = 0.25;
/** In pixels. A dash never leaves out what differs by more from what was drawn before it: a spike. */
const SPIKE = 2;

/** Draws the columns `from` to `to` of a curve. */
export function drawColumns(pen: Pen, columns: Columns, from: number, to: number, frame: Frame) {
  const { x, y, dash, stepped } = frame;
  let joined = false;
  let previous = 0;
  // What the last dash reached.
  let top = 0;
  let bottom = 0;
  let wasDrawn = false;
  for (let k = from; k <= to; k += 1) {
    const slot = columns.slot(k);
    const broken = columns.broken[slot]!;
    if (!columns.has[slot]) {
      if (broken) joined = false;
      continue;
    }
    if (broken & BROKEN_BEFORE) joined = false;
    const at = x((k + 0.5) * columns.width);
    const least = y(columns.min[slot]!);
    const most = y(columns.max[slot]!);
    // Two points a column, the nearer one first. More points look the same, and the browser paints longer.
    const upwards = !joined || Math.abs(previous - least) < Math.abs(previous - most);
    const near = upwards ? least : most;
    const far = upwards ? most : least;
    const isDash = isDrawn(k, dash);
    const isSpike = most < top - SPIKE || least > bottom + SPIKE;
    if (isDash || !joined) {
      const goesOn = wasDrawn && joined;
      top = goesOn ? Math.min(top, most) : most;
      bottom = goesOn ? Math.max(bottom, least) : least;
    }
    wasDrawn = isDash;
    if (joined && (isDash || isSpike)) {
      if (stepped) pen.lineTo(at, previous);
      pen.lineTo(at, near);
      if (least - most > FLAT) pen.lineTo(at, far);
    } else if (!joined && least - most < FLAT) {
      dot(pen, at, far);
    } else if (!joined) {
      pen.moveTo(at, near);
      pen.lineTo(at, far);
    } else {
      pen.moveTo(at, far);
    }
    joined = !(broken & BROKEN_AFTER);
    previous = far;
  }
}

/** Draws each sample at its own time, as long as there are few. */
export function drawSamples(pen: Pen, samples: Samples, from: number, to: number, frame: Frame, width: number) {
  const { x, y, dash, stepped } = frame;
  let joined = false;
  let previousX = 0;
  let previousY = 0;
  for (let number = from; number < to; number += 1) {
    const value = samples.y(number);
    if (!isFinite(value)) {
      joined = false;
      continue;
    }
    const time = samples.x(number);
    const nowX = x(time);
    const nowY = y(value);
    if (!joined) {
      pen.moveTo(nowX, nowY);
      dot(pen, nowX, nowY);
    } else {
      if (stepped) dashed(pen, previousX, previousY, nowX, previousY, dash, x, width);
      dashed(pen, stepped ? nowX : previousX, previousY, nowX, nowY, dash, x, width);
    }
    joined = true;
    previousX = nowX;
    previousY = nowY;
  }
}

/** A line whose dashes lie on the grid of columns, as those of `drawColumns` do. */
function dashed(
  pen: Pen, x0: number, y0: number, x1: number, y1: number, dash: readonly number[], x: Frame['x'], width: number,
) {
  const [period, drawn] = dash as [number, number];
  const pixel = x(width) - x(0);
  const isSpike = Math.abs(y1 - y0) > SPIKE && x1 - x0 < (period - drawn) * pixel;
  if (period === 0 || isSpike) {
    pen.lineTo(x1, y1);
    return;
  }
  const origin = x(0);
  const length = period * pixel;
  const on = drawn * pixel;
  for (let start = origin + Math.floor((x0 - origin) / length) * length; start < x1; start += length) {
    const from = Math.max(start, x0);
    const to = Math.min(start + on, x1);
    if (to <= from) continue;
    const at = (place: number) => y0 + ((y1 - y0) * (place - x0)) / (x1 - x0);
    if (from > x0) pen.moveTo(from, at(from));
    pen.lineTo(to, at(to));
  }
  pen.moveTo(x1, y1);
}

function isDrawn(k: number, dash: readonly number[]): boolean {
  const period = dash[0]!;
  return period === 0 || ((k % period) + period) % period < dash[1]!;
}

/** A single value is not a line. */
function dot(pen: Pen, x: number, y: number) {
  pen.moveTo(x - 1.5, y);
  pen.lineTo(x + 1.5, y);
  pen.moveTo(x, y);
}
