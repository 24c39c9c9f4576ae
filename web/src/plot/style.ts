// How curves differ: by colour and by dashes, so that no two of 40 look alike, with or without colours.
// Contrast with the card behind them is 4.5 or more, see style.test.ts.

export const LIGHT = ['#0a57c2', '#b3201a', '#1a7431', '#7a3db8', '#8a4b00', '#00697a', '#a3176f', '#4f5a66'];
export const DARK = ['#74b4ff', '#ff8a80', '#56cc78', '#cda2ff', '#f2b04e', '#4fd3e0', '#ff8fcb', '#c3ccd6'];

/** Of a period and its drawn part, in CSS pixels. */
export const DASHES: readonly (readonly [period: number, drawn: number])[] = [
  [0, 0],
  [12, 8],
  [6, 3],
  [20, 16],
  [14, 4],
];

export interface Style {
  light: string;
  dark: string;
  dash: readonly [period: number, drawn: number];
}

/** The look of curve `index`. The first eight differ in colour, neighbours also in their dashes. */
export function styleOf(index: number): Style {
  const colour = index % LIGHT.length;
  return { light: LIGHT[colour]!, dark: DARK[colour]!, dash: DASHES[index % DASHES.length]! };
}

/** The first free number for each curve that is new; the others keep theirs. */
export function numbered(keys: readonly string[], known: ReadonlyMap<string, number>): Map<string, number> {
  const result = new Map<string, number>();
  for (const key of keys) {
    const number = known.get(key);
    if (number !== undefined) result.set(key, number);
  }
  const used = new Set(result.values());
  let free = 0;
  for (const key of keys) {
    if (result.has(key)) continue;
    while (used.has(free)) free += 1;
    used.add(free);
    result.set(key, free);
  }
  return result;
}
