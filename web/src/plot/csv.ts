// The visible samples as a CSV file.
import type { Trace } from './chart';
import { rows } from './rows';

export interface Columns {
  /** Names of the columns of time. */
  header: string[];
  /** Their texts for a row. */
  times: (x: number, line: string) => string[];
}

const AT_ONCE = 8;

/** The file, in parts. Other work goes on between them: signs of life must not wait. */
export async function csv(
  traces: readonly Trace[], min: number, max: number, { header, times }: Columns,
  pause = () => new Promise<void>((done) => setTimeout(done)),
): Promise<string[]> {
  const names = traces.map(({ name, unit }) => (unit ? `${name} (${unit})` : name));
  const parts = [csvLine([...header, ...names])];
  let part = '';
  let since = performance.now();
  for (const { x, line: of, values } of rows(traces, min, max)) {
    part += csvLine([...times(x, of), ...values.map((value) => (value === undefined || isNaN(value) ? '' : String(value)))]);
    if (performance.now() - since < AT_ONCE) continue;
    parts.push(part);
    part = '';
    await pause();
    since = performance.now();
  }
  return [...parts, part];
}

/** A row of a file, with its end. */
export function csvLine(fields: readonly string[]): string {
  return `${fields.map(quoted).join(',')}\r\n`;
}

function quoted(field: string): string {
  return /[",\r\n]/.test(field) ? `"${field.replaceAll('"', '""')}"` : field;
}

/** A wall clock in ISO 8601, with microseconds. `origin` is whole seconds since 1970. */
export function iso(origin: number, x: number): string {
  const micros = Math.round(x * 1e6);
  const seconds = Math.floor(micros / 1e6);
  const fraction = String(micros - seconds * 1e6).padStart(6, '0');
  return `${new Date((origin + seconds) * 1000).toISOString().slice(0, 19)}.${fraction}Z`;
}

/** Lets the browser save a file. */
export function save(name: string, parts: string[], type = 'text/csv') {
  const url = URL.createObjectURL(new Blob(parts, { type }));
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}
