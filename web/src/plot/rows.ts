// Samples of several curves as rows: for the table behind a plot, and for CSV.
import type { Trace } from './chart';
import { BREAK } from './samples';

/** What a row needs of a curve. */
export type Source = Pick<Trace, 'line' | 'samples'>;

/** The samples of one instant of a line. A curve without a sample then has `undefined`. */
export interface Row {
  x: number;
  line: string;
  values: (number | undefined)[];
}

/** The samples between `min` and `max`, inclusive, by time. */
export function* rows(sources: readonly Source[], min: number, max: number): Generator<Row> {
  const next = sources.map(({ samples }) => samples.at(min));
  for (;;) {
    let x = Infinity;
    let line = '';
    sources.forEach((source, index) => {
      const number = skipped(source, next, index);
      if (number >= source.samples.end) return;
      const time = source.samples.x(number);
      if (time < x || (time === x && source.line < line)) {
        x = time;
        line = source.line;
      }
    });
    if (!(x <= max)) return;
    const values = sources.map((source, index) => {
      const number = next[index]!;
      if (source.line !== line || number >= source.samples.end || source.samples.x(number) !== x) return undefined;
      next[index] = number + 1;
      return source.samples.y(number);
    });
    yield { x, line, values };
  }
}

/** Breaks are not samples. Those that were dropped meanwhile are left out. */
function skipped({ samples }: Source, next: number[], index: number): number {
  let number = Math.max(next[index]!, samples.first);
  while (number < samples.end && samples.y(number) === BREAK) number += 1;
  next[index] = number;
  return number;
}

/** At most `count` rows that end before `x`, in ascending order. */
export function rowsBefore(sources: readonly Source[], min: number, x: number, count: number): Row[] {
  // A curve with many samples gives enough rows alone: no need to look at earlier ones.
  let from = min;
  for (const { samples } of sources) {
    const first = samples.at(x) - 2 * count;
    if (first >= samples.first) from = Math.max(from, samples.x(first));
  }
  const found: Row[] = [];
  for (const row of rows(sources, from, x)) if (row.x < x) found.push(row);
  return found.slice(-count);
}
