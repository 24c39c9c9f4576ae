// Registers as a person sees them: search, values that can be written, what has changed.
import type { Difference, Register } from '../wire';

/** The registers that have all words of a search in name, meaning, unit or group. */
export function found(registers: readonly Register[], search: string): Register[] {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  return registers.filter(({ name, doc, unit, group }) => {
    const text = `${name} ${doc} ${unit} ${group}`.toLowerCase();
    return words.every((word) => text.includes(word));
  });
}

/** Neighbouring registers of the same group, in the order of the table. */
export function groups(registers: readonly Register[]): { group: string; registers: Register[] }[] {
  const all: { group: string; registers: Register[] }[] = [];
  for (const register of registers) {
    const known = all.find(({ group }) => group === register.group);
    if (known) known.registers.push(register);
    else all.push({ group: register.group, registers: [register] });
  }
  return all;
}

export function access({ readable, writable }: Register): string {
  if (readable && writable) return 'read, write';
  if (readable) return 'read';
  return writable ? 'write' : 'none';
}

export function rangeText(range: readonly [number, number, number] | null, unit = ''): string {
  if (!range) return '';
  const [least, most, step] = range;
  const steps = step > 0 && step !== 1 ? `, step ${short(step)}` : '';
  return `${withUnit(`${short(least)} to ${short(most)}`, unit)}${steps}`;
}

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

/** The number of a text that a register or a field takes, or why it takes none. */
export function numberOf(
  text: string,
  { range, unit }: { range: readonly [number, number, number] | null; unit: string },
): { value: number } | { why: string } {
  const trimmed = text.trim().replace('−', '-');
  if (!trimmed) return { why: 'Enter a number.' };
  if (trimmed.includes(',')) return { why: 'Write decimals with a point.' };
  if (!NUMBER.test(trimmed)) return { why: `\`${trimmed}\` is not a number.` };
  const value = Number(trimmed);
  if (!range) return { value };
  const [least, most, step] = range;
  if (value < least || value > most) return { why: `Out of range: ${rangeText(range, unit)}.` };
  if (step > 0) {
    const steps = value / step;
    const lower = Math.floor(steps);
    if (Math.abs(steps - Math.round(steps)) > 1e-6) {
      return { why: `The step is ${short(step)}: ${short(lower * step)} or ${short((lower + 1) * step)}.` };
    }
  }
  return { value };
}

/** A value with its unit, if it has one. */
export function withUnit(text: string | number, unit: string): string {
  return unit ? `${text} ${unit}` : String(text);
}

/** A number without the noise of its last bits. */
export function short(value: number): string {
  return String(Number(value.toPrecision(12)));
}

/** Whether what was read back is what was written, as far as the register can tell. */
export function isSame(written: number, read: number, step: number): boolean {
  return Math.abs(written - read) <= Math.max(step / 2, 1e-6 * Math.abs(written));
}

/** What differs between a motor and a file, by register. */
export function byName(differences: readonly Difference[]): ReadonlyMap<string, Difference> {
  return new Map(differences.map((difference) => [difference.name, difference]));
}
