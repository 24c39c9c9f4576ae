// Finds signals by words.
import type { Column, SignalName } from '../wire';

export interface Candidate extends SignalName {
  unit: string;
  id: SignalName;
}

/**
 * Signals whose line, name or unit contain each word of `search`; those whose name begins with a word first. A
 * number is also that of a motor. A word such as `st0/1` is one motor, and no other.
 */
export function candidates(
  motors: ReadonlyMap<string, readonly number[]>,
  catalogue: ReadonlyMap<string, readonly Column[]>,
  search: string,
): Candidate[] {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  const first: Candidate[] = [];
  const others: Candidate[] = [];
  for (const [line, found] of motors) {
    const columns = catalogue.get(line) ?? [];
    for (const motor of found) {
      for (const { name, unit } of columns) {
        const lower = name.toLowerCase();
        const parts = [line.toLowerCase(), unit.toLowerCase(), lower];
        const motorName = `${line.toLowerCase()}/${motor}`;
        const fits = words.every((word) =>
          word.includes('/')
            ? word === motorName || (word.endsWith('/') && motorName.startsWith(word))
            : String(motor) === word || parts.some((part) => part.includes(word)));
        if (!fits) continue;
        const begins = words.some((word) => lower.startsWith(word));
        (begins ? first : others).push({ line, motor, name, unit, id: { line, motor, name } });
      }
    }
  }
  return [...first, ...others];
}
