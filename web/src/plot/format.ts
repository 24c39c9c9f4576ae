// Numbers and times as texts of nearly constant width.

const MINUS = '−';

/** A value with about six digits. */
export function value(number: number): string {
  if (!isFinite(number)) return '–';
  const size = Math.abs(number);
  const text = () => {
    if (Number.isInteger(size) && size < 1e12) return String(size);
    if (size >= 1e7 || size < 1e-4) return size.toExponential(4);
    return size.toFixed(Math.min(Math.max(5 - Math.floor(Math.log10(size)), 0), 4));
  };
  return `${number < 0 ? MINUS : ''}${text()}`;
}

/** A value at an axis whose ticks are `step` apart. */
export function onAxis(number: number, step: number): string {
  if (Math.abs(number) >= 1e7 || (step < 1e-6 && number !== 0)) return value(number);
  return number.toFixed(decimalsOf(step)).replace('-', MINUS);
}

/** A value and its unit. */
export function withUnit(number: number, unit: string): string {
  return isFinite(number) && unit ? `${value(number)} ${unit}` : value(number);
}

/** A length of time. */
export function duration(seconds: number): string {
  const size = Math.abs(seconds);
  if (!isFinite(size)) return '–';
  const sign = seconds < 0 ? MINUS : '';
  if (size < 1e-3) return `${sign}${(size * 1e6).toFixed(0)} µs`;
  if (size < 1) return `${sign}${(size * 1e3).toFixed(2)} ms`;
  if (size < 120) return `${sign}${size.toFixed(3)} s`;
  return `${sign}${Math.floor(size / 60)} min ${(size % 60).toFixed(1)} s`;
}

/** How old something is. */
export function age(seconds: number): string {
  if (!isFinite(seconds)) return 'no value yet';
  return seconds < 120 ? `${Math.floor(seconds)} s old` : `${Math.floor(seconds / 60)} min old`;
}

/** What a plot writes at its time axis, beside its cursors and into its table. */
export interface Clock {
  /** At the axis, whose ticks are `step` seconds apart. */
  tick: (x: number, step: number) => string;
  /** To the resolution of samples. */
  full: (x: number) => string;
}

const two = (number: number) => String(number).padStart(2, '0');

const MOST_DECIMALS = 7;

/** Decimals that multiples of a step need: 2 for 0.25. */
function decimalsOf(step: number): number {
  for (let decimals = 0; decimals < MOST_DECIMALS; decimals += 1) {
    const scaled = step * 10 ** decimals;
    if (Math.abs(scaled - Math.round(scaled)) < 1e-6 * scaled) return decimals;
  }
  return MOST_DECIMALS;
}

/** The time of day at `origin + x` seconds since 1970. */
export function dayClock(origin: number): Clock {
  const text = (x: number, decimals: number) => {
    const unit = 10 ** decimals;
    const rounded = Math.round((x + origin) * unit) / unit;
    const date = new Date(Math.floor(rounded) * 1000);
    const fraction = decimals ? (rounded - Math.floor(rounded)).toFixed(decimals).slice(1) : '';
    return `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}${fraction}`;
  };
  return { tick: (x, step) => text(x, decimalsOf(step)), full: (x) => text(x, 4) };
}

/** Seconds from the zero of the data. */
export const secondsClock: Clock = {
  tick: (x, step) => `${x.toFixed(decimalsOf(step)).replace('-', MINUS)} s`,
  full: (x) => `${x.toFixed(4).replace('-', MINUS)} s`,
};
