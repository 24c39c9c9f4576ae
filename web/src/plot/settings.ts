// What the plots remember: in the browser, checked when it is read.
import type { SignalName } from '../wire';
import { LONGEST } from './store';

/** In Hz. A page may have 16 subscriptions, one for each rate, and other views need some. */
export const RATES = [2, 5, 20, 50, 100, 200, 500, 1000] as const;
/** In seconds. */
export const SPANS = [10, 30, 60, 120, 300, 600] as const;
export const LAYOUTS = ['one', 'unit', 'motor'] as const;
export const MOST_SIGNALS = 64;

export type Layout = (typeof LAYOUTS)[number];

export interface Chosen extends SignalName {
  rate: number;
}

export interface Settings {
  signals: Chosen[];
  span: number;
  layout: Layout;
}

export const DEFAULTS: Settings = { signals: [], span: 30, layout: 'one' };
const PLACE = 'motorlink.plots';
const LONGEST_NAME = 200;

type Storage = Pick<globalThis.Storage, 'getItem' | 'setItem'>;

export function load(storage: Storage): Settings {
  try {
    return parse(JSON.parse(storage.getItem(PLACE) ?? '{}'));
  } catch {
    return DEFAULTS;
  }
}

/** Whether there are settings of an earlier visit. */
export function remembers(storage: Storage): boolean {
  try {
    return storage.getItem(PLACE) !== null;
  } catch {
    return false;
  }
}

export function save(storage: Storage, settings: Settings) {
  try {
    storage.setItem(PLACE, JSON.stringify(settings));
  } catch {
    // Private windows may refuse. The settings then end with the page.
  }
}

const MOST_USUAL = 6;
const USUAL_RATE = 20;

/** What is shown to somebody who has chosen nothing: the speeds of the first motors. */
export function usual(
  motors: readonly { line: string; motor: number }[], speedOf: (line: string) => string | undefined,
): Chosen[] {
  return motors
    .flatMap(({ line, motor }) => {
      const name = speedOf(line);
      return name === undefined ? [] : [{ line, motor, name, rate: USUAL_RATE }];
    })
    .slice(0, MOST_USUAL);
}

/** What of it is usable. */
export function parse(from: unknown): Settings {
  if (typeof from !== 'object' || from === null) return DEFAULTS;
  const { signals, span, layout } = from as Record<string, unknown>;
  const seen = new Set<string>();
  const chosen = (Array.isArray(signals) ? signals : []).map(parseSignal).filter((one) => one !== null);
  return {
    signals: chosen
      .filter(({ line, motor, name }) => {
        const key = JSON.stringify([line, motor, name]);
        return !seen.has(key) && seen.add(key);
      })
      .slice(0, MOST_SIGNALS),
    span: typeof span === 'number' && span >= 1 && span <= LONGEST ? span : DEFAULTS.span,
    layout: LAYOUTS.find((one) => one === layout) ?? DEFAULTS.layout,
  };
}

function parseSignal(from: unknown): Chosen | null {
  if (typeof from !== 'object' || from === null) return null;
  const { line, motor, name, rate } = from as Record<string, unknown>;
  const isText = (text: unknown): text is string =>
    typeof text === 'string' && text.length > 0 && text.length <= LONGEST_NAME;
  if (!isText(line) || !isText(name) || !Number.isSafeInteger(motor) || (motor as number) < 0) return null;
  return { line, name, motor: motor as number, rate: RATES.find((one) => one === rate) ?? 20 };
}
