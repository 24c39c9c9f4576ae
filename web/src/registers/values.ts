// The values of registers that were read, by motor. They stay when the view is left.
import { type Signal, batch, signal } from '@preact/signals';
import { Refused, ask } from '../link';
import type { Difference, Event as DriveEvent, MotorName, Value } from '../wire';
import { byName } from './model';

export interface Cell {
  /** The value that was read first. */
  first: Value;
  now: Value;
  /** When it was read: of `performance.now()`. */
  at: number;
}

/** What the page knows of the registers of a motor. */
export interface Sheet {
  motor: MotorName;
  cells: Signal<ReadonlyMap<string, Cell>>;
  /** Texts that were typed and not written. */
  drafts: Signal<ReadonlyMap<string, string>>;
  /** Why a register could not be written or read, or what was read back. */
  notes: Signal<ReadonlyMap<string, Note>>;
  /** The names that are being read. */
  reading: Signal<number>;
  file: Signal<LoadedFile | null>;
}

export interface Note {
  isBad: boolean;
  text: string;
}

/** A file of settings, and what differed when it was compared last. */
export interface LoadedFile {
  name: string;
  text: string;
  differences: ReadonlyMap<string, Difference>;
}

/** One request reads so many, so that stops and other pages are never far behind. */
const BATCH = 12;

const sheets = new Map<string, Sheet>();

/** The motor that the views of registers, settings and steps show. */
export const chosen = signal<MotorName | null>(null);

export function sheetOf(motor: MotorName): Sheet {
  const key = `${motor.line}/${motor.motor}`;
  const known = sheets.get(key);
  if (known) return known;
  const sheet: Sheet = {
    motor, cells: signal(new Map()), drafts: signal(new Map()), notes: signal(new Map()),
    reading: signal(0), file: signal(null),
  };
  sheets.set(key, sheet);
  return sheet;
}

/** Values of a motor were read. */
export function keep(sheet: Sheet, values: readonly Value[]) {
  const { cells } = sheet;
  const at = performance.now();
  const next = new Map(cells.value);
  for (const value of values) {
    const known = next.get(value.name);
    // What was read back is not true any more.
    if (known && known.now.text !== value.text && !sheet.notes.value.get(value.name)?.isBad) note(sheet, value.name, null);
    // The first value is one that was read, not a refusal.
    const first = known && known.first.value !== null ? known.first : value;
    next.set(value.name, { first, now: value, at });
  }
  cells.value = next;
}

/** Whether an event says that this motor was stopped: what was read before is not true any more. */
export function isStopOf({ event, line, motor }: DriveEvent, of: MotorName): boolean {
  const isStop = event === 'stopped' || event === 'stop-failed';
  return isStop && (line ?? of.line) === of.line && (motor ?? of.motor) === of.motor;
}

/** Reads registers in batches until all are read or `isWanted` says no. */
export async function read(sheet: Sheet, names: readonly string[], isWanted: () => boolean = () => true) {
  if (!names.length) return;
  sheet.reading.value += 1;
  try {
    for (let from = 0; from < names.length && isWanted(); from += BATCH) {
      const { values } = await ask({ ask: 'read', ...sheet.motor, names: names.slice(from, from + BATCH) });
      keep(sheet, values);
    }
  } finally {
    sheet.reading.value -= 1;
  }
}

export function draft({ drafts }: Sheet, name: string, text: string | null) {
  drafts.value = changed(drafts.value, name, text);
}

export function note({ notes }: Sheet, name: string, text: Note | null) {
  notes.value = changed(notes.value, name, text);
}

function changed<T>(map: ReadonlyMap<string, T>, name: string, value: T | null): ReadonlyMap<string, T> {
  const next = new Map(map);
  if (value === null) next.delete(name);
  else next.set(name, value);
  return next;
}

/** Writes a register. Returns what was read back; throws `Refused`. */
export async function write(sheet: Sheet, name: string, value: number, toRom: boolean): Promise<Value[]> {
  const { values } = await ask({ ask: 'write', ...sheet.motor, name, value, to_rom: toRom });
  batch(() => {
    keep(sheet, values);
    draft(sheet, name, null);
  });
  return values;
}

/** Compares a file with a motor. Throws `Refused`. */
export async function compare(sheet: Sheet, name: string, text: string): Promise<LoadedFile> {
  const { differences } = await ask({ ask: 'diff', ...sheet.motor, text });
  const file = { name, text, differences: byName(differences) };
  sheet.file.value = file;
  return file;
}

export function reasonOf(why: unknown): string {
  if (why instanceof Refused || why instanceof Error) return sentence(why.message);
  return sentence(String(why));
}

/** Messages of the server have no full stop. */
function sentence(message: string): string {
  return /[.!?]$/.test(message) ? message : `${message}.`;
}
