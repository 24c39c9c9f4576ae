// Numbers and times as text of a width that does not change.

const MINUS = '−';

/** The decimals that a value of a unit is shown with. */
const DECIMALS: Readonly<Record<string, number>> = { A: 2, V: 1, VA: 1, W: 1, '°': 1, Ω: 3, ms: 1 };

export const decimalsOf = (unit: string): number => DECIMALS[unit] ?? 0;

/** The decimals of values that are whole numbers of a step. */
export const decimalsOfStep = (step: number): number => Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));

/** A number with a fixed number of decimals. NaN is a dash. */
export function number(value: number, decimals: number): string {
  if (!Number.isFinite(value)) return '–';
  const text = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/** An age as text, if a value of that age is not live. */
export function tooOld(age: number): string | null {
  if (Number.isNaN(age)) return 'age unknown';
  return age > LIVE ? `${duration(age)} old` : null;
}

/** A value that is older than this, in seconds, is not shown as live. */
export const LIVE = 1;

/** A time in its largest fitting unit. */
export function duration(seconds: number): string {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${Math.floor(seconds)} s`;
  if (seconds < 7200) return `${Math.floor(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h`;
}

/** A rate of values a second. */
export function rate(perSecond: number): string {
  if (!Number.isFinite(perSecond)) return '–';
  const text = perSecond < 9.95 ? perSecond.toFixed(1) : perSecond.toFixed(0);
  // A space that is as wide as a digit.
  return `${text.padStart(3, '\u2007')}/s`;
}

const TIME = new Intl.DateTimeFormat('en-GB', {
  hour: '2-digit',
  minute: '2-digit',
  second: '2-digit',
  fractionalSecondDigits: 3,
});

/** The time of day of a wall clock in seconds since 1970. */
export function timeOfDay(wall: number): string {
  return Number.isFinite(wall) ? TIME.format(wall * 1000) : '–';
}

/** The node of a line of a fleet: `arm1` of `arm1/st0`. Lines of one share have none. */
export function nodeOf(line: string): string | null {
  const end = line.indexOf('/');
  return end < 0 ? null : line.slice(0, end);
}

/** The name of a motor. Number 0 stands for any motor of a line on which nothing has answered. */
export const nameOf = (line: string, motor: number) => (motor === 0 ? line : `${line}/${motor}`);

/** A text of a table as a sentence. */
export function sentence(text: string): string {
  const first = text.charAt(0).toUpperCase() + text.slice(1);
  return text === '' || /[.!?]$/.test(text) ? first : `${first}.`;
}
