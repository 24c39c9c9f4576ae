// What the page knows of lines and motors: descriptions, events about them, and rates.
import { computed, effect, signal } from '@preact/signals';
import { nameOf, nodeOf } from './format';
import { ask, entries, found, lines, motors, searchFailed, searching, welcome } from './link';
import type { Description, Event as DriveEvent, Mode, SignalRate } from './wire';

export interface MotorId {
  line: string;
  motor: number;
}

/** All motors that were found, in the order of the lines. */
export const allMotors = computed<MotorId[]>(() =>
  lines.value.flatMap(({ line }) => (motors.value.get(line) ?? []).map((motor) => ({ line, motor }))),
);

/** The nodes of a fleet. None without one. */
export const nodes = computed<string[]>(() => [
  ...new Set(lines.value.map(({ line }) => nodeOf(line)).filter((node) => node !== null)),
]);

/** With more motors only those of one node are shown. */
const MANY = 24;

/** The node that was chosen, `null` for all. `undefined`: none was chosen. */
export const chosenNode = signal<string | null | undefined>(undefined);

/** The node whose motors are shown, `null` for all. */
export const shownNode = computed<string | null>(() => {
  const chosen = chosenNode.value;
  if (chosen === null || (chosen !== undefined && nodes.value.includes(chosen))) return chosen;
  return allMotors.value.length > MANY ? (nodes.value[0] ?? null) : null;
});

/** The motors that have a card. */
export const shownMotors = computed<MotorId[]>(() =>
  allMotors.value.filter(({ line }) => shownNode.value === null || nodeOf(line) === shownNode.value),
);

/** What the drives of a line have, by line. */
export const descriptions = signal<ReadonlyMap<string, Description>>(new Map());

/** Why a line could not be described. */
export const describeFailed = signal<string | null>(null);

let describedRun = '';

/** Asks for the descriptions of lines that have none. Returns why that failed. */
export async function describeLines(): Promise<string | null> {
  const run = welcome.value?.run;
  const names = lines.value.map(({ line }) => line);
  if (run === undefined) return null;
  if (run !== describedRun) {
    describedRun = run;
    descriptions.value = new Map();
  }
  let failure: string | null = null;
  for (const line of names) {
    if (descriptions.peek().has(line)) continue;
    try {
      const description = await ask({ ask: 'describe', line });
      descriptions.value = new Map(descriptions.peek()).set(line, description);
    } catch (why) {
      failure = (why as Error).message;
    }
  }
  describeFailed.value = failure;
  return failure;
}

/** Describes lines, again with each connection and each answer to `lines`. Returns what ends it. */
export const watchDescriptions = (): (() => void) => effect(() => void describeLines());

/** Rounding of times, in seconds. */
const ROUNDING = 0.001;

/**
 * The newest event of the given kinds about each line or motor, by name. Events from before the line was opened
 * are of another share, or of another port.
 */
function newest(all: readonly DriveEvent[], kinds: ReadonlySet<string>, isOfMotor: boolean) {
  const opened = new Map(lines.value.map(({ line, t, wall }) => [line, wall - t - ROUNDING]));
  const found = new Map<string, DriveEvent>();
  for (const event of all) {
    if (!event.line || !kinds.has(event.event) || event.wall < (opened.get(event.line) ?? 0)) continue;
    if (!isOfMotor) found.set(event.line, event);
    else if (event.motor != null) found.set(nameOf(event.line, event.motor), event);
  }
  return found;
}

const LINE_KINDS = new Set(['lost', 'back', 'opened']);
const MOTOR_KINDS = new Set(['silent', 'answers', 'stop-failed', 'stopped']);

/** The last loss or return of each line since the page was opened. */
export const lineEvents = computed(() => newest(entries.value, LINE_KINDS, false));
/** The last time each motor fell silent or answered again, or its stop failed or was confirmed. */
export const motorEvents = computed(() => newest(entries.value, MOTOR_KINDS, true));

/** Whether motors were searched on all lines, and no search is under way. */
export const isSearched = computed(
  () =>
    welcome.value !== null &&
    lines.value.length > 0 &&
    searching.value.size === 0 &&
    lines.value.every(({ line }) => found.value.has(line) || searchFailed.value.has(line)),
);

/** The rates of all signals that are read. */
export const rates = signal<readonly SignalRate[]>([]);

/** The share counts from the last values on: with less than this part of its rate a signal is not read now. */
const READ = 0.25;

/** Whether values of a signal come. */
export const isRead = ({ achieved, predicted }: SignalRate) => achieved * predicted > READ;

/**
 * Whether a motor does not answer. Without an event about it that is a motor which the last search did
 * not find, and of which no values come. No motor of a lost line answers.
 */
export function isSilent(line: string, motor: number): boolean {
  if (lineEvents.value.get(line)?.event === 'lost') return true;
  const last = motorEvents.value.get(nameOf(line, motor))?.event;
  if (last === 'silent') return true;
  if (last === 'answers' || last === 'stopped') return false;
  if (rates.value.some((one) => one.line === line && one.motor === motor && isRead(one))) return false;
  // While stops are repeated nothing is read, and nothing else says that it is silent.
  if (last === 'stop-failed') return true;
  const isSearched = found.value.has(line) || searchFailed.value.has(line);
  return isSearched && !found.value.get(line)?.includes(motor);
}

/** For so long, in ms, a slow signal keeps its rate: between two windows of the share it has none. */
const KEPT = 3000;
const SLOW = 0.5;
const kept = new Map<string, { achieved: number; at: number }>();

/** A slow signal has a rate of 0 in some windows of the share although it is read. */
export function steady(all: readonly SignalRate[], now = performance.now()): SignalRate[] {
  return all.map((one) => {
    const name = `${nameOf(one.line, one.motor)} ${one.name}`;
    if (one.achieved > 0) kept.set(name, { achieved: one.achieved, at: now });
    const last = kept.get(name);
    const isKept = one.achieved === 0 && one.asked >= SLOW && last !== undefined && now - last.at < KEPT;
    return isKept ? { ...one, achieved: last.achieved } : one;
  });
}

/** Asks for the rates again and again. Returns what ends it. */
export function watchRates(period = 1000): () => void {
  const look = () =>
    ask({ ask: 'rates' }).then(
      (answer) => void (rates.value = steady(answer.rates)),
      () => void (rates.value = []),
    );
  void look();
  const timer = setInterval(look, period);
  return () => clearInterval(timer);
}

interface Named {
  start: string;
  /** What the button for it says, and what it does. */
  title: string;
  hint: string;
  acknowledge: string;
}

/** The names of the commands that each drive has under another name, as in its table. */
export const COMMANDS: Readonly<Record<Description['protocol'], Named>> = {
  st: {
    start: 'START_MOTOR',
    title: 'Start',
    hint: 'The motor goes to the last reference of the drive.',
    acknowledge: 'FAULT_ACK',
  },
  rmd: {
    start: 'run',
    title: 'Resume',
    hint: 'The motor goes on with its motion before the stop, at once and without a ramp.',
    acknowledge: 'clear_errors',
  },
};

/** What pages may ask of a motor at most, by motor and mode. `null`: it is unknown. */
export const limits = signal<ReadonlyMap<string, number> | null>(null);

export const limitName = (line: string, motor: number, mode: Mode) => `${nameOf(line, motor)} ${mode}`;

/** Asks for the limits again and again: other pages set them, too. Returns what ends it. */
export function watchLimits(period = 2000): () => void {
  void readLimits();
  const timer = setInterval(() => void readLimits(), period);
  return () => clearInterval(timer);
}

async function readLimits() {
  try {
    const answer = await ask({ ask: 'limits' });
    limits.value = new Map(answer.limits.map(({ line, motor, mode, most }) => [limitName(line, motor, mode), most]));
  } catch {
    // They are unknown until a later answer.
    limits.value = null;
  }
}

/** Sets or, with `null`, removes the limit of a mode. It holds for all pages. */
export async function setLimit(line: string, motor: number, mode: Mode, most: number | null) {
  await ask({ ask: 'limit', line, motor, mode, most });
  await readLimits();
}
