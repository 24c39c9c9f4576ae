// Parts of recordings: what the server sends for a plot, and how parts are put together.
import { decodeColumns, groupOf } from '../rows';
import type { RecordingPart } from '../wire';

/** The points of a signal, in the order of time. NaN is a gap. */
export interface Points {
  t: Float64Array;
  values: Float64Array;
}

export interface Part {
  head: RecordingPart;
  /** By the number of the signal. Signals without samples are missing. */
  points: ReadonlyMap<number, Points>;
}

/** Length and kind of a message, before its payload (docs/SHARE-PROTOCOL.md). */
const HEADER = 8;
const TEXT = 1;

/** Reads the answer of the server. */
export function read(buffer: ArrayBuffer): Part {
  const bytes = new DataView(buffer);
  let head: RecordingPart | null = null;
  const points = new Map<number, Points>();
  let at = 0;
  while (at + HEADER <= buffer.byteLength) {
    const [length, kind] = [bytes.getUint32(at, true), bytes.getUint8(at + 4)];
    at += HEADER;
    if (at + length > buffer.byteLength) throw cut();
    const payload = buffer.slice(at, at + length);
    at += length;
    if (kind === TEXT) {
      head = JSON.parse(new TextDecoder().decode(payload)) as RecordingPart;
      continue;
    }
    const number = groupOf(payload);
    const columns = decodeColumns(payload, 1);
    if (number === null || !columns) throw new Error('The server sent samples that cannot be read.');
    points.set(number, { t: columns.t, values: columns.values[0]! });
  }
  if (!head || at !== buffer.byteLength) throw cut();
  return { head, points };
}

const cut = () => new Error('The server sent a part of a recording that is not whole.');

/** The whole recording with few points, and in it a part with more. */
export function splice(whole: Points, part: Points, { from, to }: Pick<RecordingPart, 'from' | 'to'>): Points {
  const before = firstFrom(whole.t, from);
  let after = firstFrom(whole.t, to);
  while (after < whole.t.length && whole.t[after]! <= to) after += 1;
  // A part has a sample on both sides of its ends. The whole has these places, too.
  const first = firstFrom(part.t, from);
  let last = firstFrom(part.t, to);
  while (last < part.t.length && part.t[last]! <= to) last += 1;
  const beside = (points: Float64Array, of: Float64Array) =>
    [points.subarray(0, before), of.subarray(first, last), points.subarray(after)] as const;
  return { t: joined(beside(whole.t, part.t)), values: joined(beside(whole.values, part.values)) };
}

function joined(parts: readonly Float64Array[]): Float64Array {
  const all = new Float64Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

/** The place of the first time that is not before `t`. */
function firstFrom(times: Float64Array, t: number): number {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle]! < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** The part that is worth asking for when this is shown, or null if what is there is fine enough. */
export function finer(
  shown: { min: number; max: number },
  seconds: number,
  known: Pick<RecordingPart, 'from' | 'to'> | null,
): { from: number; to: number } | null {
  const span = shown.max - shown.min;
  if (span > 0.7 * seconds || shown.max < 0 || shown.min > seconds) return null;
  const [min, max] = [Math.max(shown.min, 0), Math.min(shown.max, seconds)];
  if (known && known.from <= min && known.to >= max && known.to - known.from <= 4 * span) return null;
  // A little more on both sides, for a short way with the pointer.
  return { from: Math.max(min - span / 2, 0), to: Math.min(max + span / 2, seconds) };
}

/** The address of the file of a recording. */
export const fileOf = (name: string): string => `api/recordings/${encodeURIComponent(name)}`;

/** Asks the server for a part of a recording. */
export async function ask(
  name: string,
  signals: readonly number[],
  { from, to }: { from: number; to: number },
  points: number,
  signal: AbortSignal,
): Promise<Part> {
  const query = new URLSearchParams({
    signals: signals.join(),
    from: String(from),
    to: String(to),
    points: String(points),
  });
  const response = await fetch(`${fileOf(name)}/part?${query}`, { signal });
  if (!response.ok) throw new Error((await response.text()).trim());
  return read(await response.arrayBuffer());
}

/** A size in its largest fitting unit. */
export function size(bytes: number): string {
  if (bytes < 1e6) return `${(bytes / 1e3).toFixed(1)} kB`;
  if (bytes < 1e9) return `${(bytes / 1e6).toFixed(1)} MB`;
  return `${(bytes / 1e9).toFixed(2)} GB`;
}

/** A time that goes on: minutes and seconds. */
export function elapsed(seconds: number): string {
  const whole = Math.floor(seconds);
  const two = (value: number) => String(value).padStart(2, '0');
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  return `${hours ? `${hours}:` : ''}${two(minutes)}:${two(whole % 60)}`;
}
