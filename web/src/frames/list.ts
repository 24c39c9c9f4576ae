// Frames of a line: which ones are shown, what is said of them, and their export.
import { csvLine } from '../plot/csv';
import type { WireFrame, WireLoad } from '../wire';

/** Half of the time around an instant, in seconds. */
export const AROUND = 0.25;
/** Frames that the page keeps. */
export const MOST_KEPT = 20_000;

/** What the address asks for. */
export interface Wanted {
  line: string | null;
  /** An instant of the line's clock, in seconds. `null`: live. */
  t: number | null;
}

export interface Filter {
  text: string;
  direction: WireFrame['direction'] | '';
  onlyErrors: boolean;
}

export const NO_FILTER: Filter = { text: '', direction: '', onlyErrors: false };

/** The line and the instant in an address such as `#/wire?line=st0&t=12.345`. */
export function wanted(hash: string): Wanted {
  const query = new URLSearchParams(hash.split('?')[1] ?? '');
  const text = query.get('t')?.trim() ?? '';
  const t = text === '' ? NaN : Number(text);
  return { line: query.get('line'), t: Number.isFinite(t) ? t : null };
}

/** The address of a line, at an instant or live. */
export function addressOf(line: string, t: number | null = null): string {
  const query = new URLSearchParams(t === null ? { line } : { line, t: t.toFixed(6) });
  return `#/wire?${query}`;
}

/** What is wrong with a frame, in words. Empty if nothing is. */
export function troubleOf({ result, retry, unanswered }: WireFrame): string {
  const words = [
    { ok: '', nack: 'NACK', damaged: 'damaged', foreign: 'other protocol', later: 'unknown' }[result],
    retry ? 'retry' : '',
    unanswered ? 'no reply' : '',
  ];
  return words.filter((word) => word !== '').join(', ');
}

const isError = (frame: WireFrame) => frame.result === 'nack' || frame.result === 'damaged' || frame.retry || frame.unanswered;

/** The frames that a filter leaves. */
export function filtered(frames: readonly WireFrame[], { text, direction, onlyErrors }: Filter): readonly WireFrame[] {
  const words = text.toLowerCase().split(/\s+/).filter((word) => word !== '');
  if (words.length === 0 && direction === '' && !onlyErrors) return frames;
  const hex = text.toLowerCase().trim();
  return frames.filter((frame) => {
    if (direction !== '' && frame.direction !== direction) return false;
    if (onlyErrors && !isError(frame)) return false;
    if (words.length === 0 || frame.bytes.includes(hex)) return true;
    const all = `${frame.words} ${frame.bytes} ${troubleOf(frame)}`.toLowerCase();
    return words.every((word) => all.includes(word));
  });
}

/** Adds frames behind others. The oldest ones are dropped. */
export function joined(frames: readonly WireFrame[], more: readonly WireFrame[], most = MOST_KEPT): readonly WireFrame[] {
  return more.length === 0 ? frames : [...frames, ...more].slice(-most);
}

/** The place of the frame that is nearest to an instant. -1 without frames. */
export function nearest(frames: readonly WireFrame[], t: number): number {
  let best = -1;
  let distance = Infinity;
  frames.forEach((frame, at) => {
    const away = Math.abs(frame.t - t);
    if (away < distance) [best, distance] = [at, away];
  });
  return best;
}

/** The rows that are in the document: those that can be seen, and some more. */
export function windowOf(count: number, top: number, height: number, row: number, spare = 20): { first: number; end: number } {
  const seen = Math.max(1, Math.ceil(height / row));
  const last = Math.max(0, count - seen);
  const at = Math.min(Math.max(0, Math.floor(top / row)), last);
  return { first: Math.max(0, at - spare), end: Math.min(count, at + seen + spare + 1) };
}

/** The load of several times after each other. */
export function sum(loads: readonly WireLoad[]): WireLoad {
  const spans = loads.map(({ from, to }) => (from == null || to == null ? 0 : to - from));
  const total = spans.reduce((one, other) => one + other, 0);
  const of = (pick: (load: WireLoad) => number) => loads.reduce((all, load) => all + pick(load), 0);
  const busy = loads.reduce((all, load, at) => all + load.busy * (spans[at] ?? 0), 0);
  return {
    from: loads.find(({ from }) => from != null)?.from ?? null,
    to: loads.findLast(({ to }) => to != null)?.to ?? null,
    bits: of(({ bits }) => bits),
    busy: total > 0 ? busy / total : 0,
    nacks: of(({ nacks }) => nacks),
    damaged: of(({ damaged }) => damaged),
    retries: of(({ retries }) => retries),
    unanswered: of(({ unanswered }) => unanswered),
  };
}

const counted = (count: number, one: string, many: string) => `${count} ${count === 1 ? one : many}`;

/** What is wrong with the frames that are listed, as a sentence. */
export function countsOf(frames: readonly WireFrame[]): string {
  const of = (is: (frame: WireFrame) => boolean | undefined) => frames.filter(is).length;
  const nacks = of(({ result }) => result === 'nack');
  const damaged = of(({ result }) => result === 'damaged');
  const retries = of(({ retry }) => retry);
  const unanswered = of((frame) => frame.unanswered);
  const troubles = [
    `${nacks} refused (NACK)`, counted(retries, 'retry', 'retries'), `${unanswered} without a reply`, `${damaged} damaged`,
  ];
  return `${counted(frames.length, 'frame is', 'frames are')} listed: ${troubles.join(', ')}.`;
}

/** The use of the line as a sentence. `isLive`: of the time up to now. */
export function told(load: WireLoad, isLive = false): string {
  const { from, to, bits, busy } = load;
  if (from == null || to == null) return 'No frames.';
  const span = to - from;
  const rate = span > 0 ? `, ${(bits / span / 1000).toFixed(1)} kbit/s` : '';
  const share = busy > 0 && busy < 0.005 ? 'less than 1 %' : `${Math.round(busy * 100)} %`;
  return `${isLive ? 'In the last' : 'In'} ${span.toFixed(1)} s: ${share} of the time waiting for replies${rate}.`;
}

export const timeOf = (t: number): string => t.toFixed(6);

/** Bytes with the identifier of a CAN frame. */
export const bytesOf = ({ id, bytes }: WireFrame): string =>
  id == null ? bytes : `${id.toString(16).padStart(3, '0')} # ${bytes}`;

/** Frames as lines of text. */
export function asText(frames: readonly WireFrame[]): string {
  return frames
    .map((frame) => {
      const trouble = troubleOf(frame);
      const arrow = frame.direction === 'to-drive' ? '->' : '<-';
      return `${timeOf(frame.t)} ${arrow} ${bytesOf(frame).padEnd(32)} ${frame.words}${trouble && ` (${trouble})`}\n`;
    })
    .join('');
}

/** Frames as comma-separated values. */
export function asCsv(frames: readonly WireFrame[]): string {
  const rows = frames.map((it) =>
    [timeOf(it.t), it.direction, it.motor, it.result, it.retry, it.unanswered, it.id, it.bytes, it.words].map((value) =>
      String(value ?? ''),
    ),
  );
  const head = ['t', 'direction', 'motor', 'result', 'retry', 'unanswered', 'id', 'bytes', 'words'];
  return [head, ...rows].map(csvLine).join('');
}
