// Values of curves at cursors.
import type { Samples } from './samples';

/** The value at `x`: that of the nearer sample, NaN in a gap. Ends of the curve reach `near` seconds far. */
export function valueAt(samples: Samples, x: number, near: number, stepped = false): number {
  const after = samples.at(x);
  const y = (number: number) => (number >= samples.first && number < samples.end ? samples.y(number) : NaN);
  const next = y(after);
  if (isFinite(next) && samples.x(after) === x) return next;
  const before = y(after - 1);
  if (isFinite(before) && isFinite(next)) {
    return stepped || x - samples.x(after - 1) <= samples.x(after) - x ? before : next;
  }
  if (isFinite(before) && x - samples.x(after - 1) <= near) return before;
  if (isFinite(next) && samples.x(after) - x <= near) return next;
  return NaN;
}

/** The difference of two cursors in time, and its reciprocal in Hz. */
export function between(a: number | null, b: number | null): { dt: number; frequency: number } | null {
  if (a === null || b === null) return null;
  return { dt: b - a, frequency: a === b ? NaN : 1 / Math.abs(b - a) };
}
