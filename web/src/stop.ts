// Stop all: by WebSocket, by HTTP if that does not answer in time, and what is known of it.
// No component of Preact is needed for it: the keys work before the page is drawn, and if drawing fails.
import { signal } from '@preact/signals';
import { nameOf } from './format';
import { Refused, ask, entries, held, lastWelcome, latchedBy, lines, motors, sayAlive, shareLost, state, welcome } from './link';
import type { StoppedMotor } from './wire';

export interface StopReport {
  /** `stopped`: every motor that was found confirmed it. `refused`: the server answers, but cannot stop them now. */
  phase: 'sent' | 'stopped' | 'unconfirmed' | 'refused' | 'unreachable';
  message: string;
  /** Each motor that did not confirm, and why. */
  failures?: readonly string[];
  /** Where else the stop went. */
  note?: string;
}

/** What is known of the last stop of all motors. */
export const stopReport = signal<StopReport | null>(null);

/** For so long the answer over the WebSocket is waited for before HTTP is tried, too. */
const SECOND_WAY = 150;
/** A server that is reached latches at once, even if motors take longer to confirm. */
const UNREACHED = 1000;

/** For so long a stop that reached nothing is sent again with the next connection. */
const AGAIN = 10_000;
/** Motors that a message names. The header has to leave room for the views on a phone. */
const MOST_NAMED = 3;
const WAITING = 'The server has the stop, and waits for the motors to confirm it.';

interface Answered {
  known: readonly StoppedMotor[];
  /** Addresses where no motor was found. */
  others: number;
}

let last = 0;
/** The answer to the last stop. */
let lastAnswer: Answered | null = null;
/** Whether the motors take long to confirm the last stop. */
let isSlow = false;
/** The newest event when all motors were stopped last. */
let before = 0;
let pressedAt = -Infinity;

/** Stops all motors, at once. Never asks anything, and can be called as often as wanted. */
export function stopAll() {
  pressedAt = performance.now();
  send();
}

function send() {
  last += 1;
  const number = last;
  before = entries.value.at(-1)?.number ?? 0;
  lastAnswer = null;
  isSlow = false;
  held.value = false;
  sayAlive();
  stopReport.value = { phase: 'sent', message: 'Stop sent. No motor has confirmed it yet.' };

  let isOver = false;
  let isTriedByHttp = false;
  /** Why the server does not stop them. */
  let refusal: Refused | undefined;
  /** Ways that may still bring an answer. */
  let ways = 0;
  const tell = (report: StopReport) => {
    if (number === last) stopReport.value = report;
  };
  const answered = (stopped: readonly StoppedMotor[]) => {
    isOver = true;
    if (number !== last) return;
    lastAnswer = sorted(stopped);
    tell(confirmed(lastAnswer));
  };
  const failed = (why: Error) => {
    ways -= 1;
    if (isOver) return;
    if (why instanceof Refused && why.reason !== 'line') refusal = why;
    if (!isTriedByHttp) return byHttp();
    isOver = ways === 0;
    if (isOver) tell(refusal ? refused(refusal) : unreachable());
  };
  const byHttp = () => {
    if (isTriedByHttp || isOver) return;
    isTriedByHttp = true;
    ways += 1;
    postStopAll().then(answered, failed);
  };

  ways += 1;
  ask({ ask: 'stop-all' }).then(({ motors: stopped }) => answered(stopped), failed);
  setTimeout(() => {
    if (!isLatchedSince()) byHttp();
  }, SECOND_WAY);
  setTimeout(() => {
    if (isOver) return;
    if (isLatchedSince()) {
      if (number === last) isSlow = true;
      return waiting();
    }
    byHttp();
    tell(unreachable());
  }, UNREACHED);
}

async function postStopAll(): Promise<StoppedMotor[]> {
  const response = await fetch('api/stop-all', { method: 'POST', keepalive: true });
  if (!response.ok) throw new Refused('refused', await response.text());
  return ((await response.json()) as { motors: StoppedMotor[] }).motors;
}

function refused(why: Refused): StopReport {
  const message = `The motors may still be turning. The server could not stop them: ${why.message}.`;
  return { phase: 'refused', message };
}

function unreachable(): StopReport {
  const { deadline, separate_share: isSeparate } = lastWelcome.value ?? {};
  const own = deadline === undefined ? 'its own deadline' : `its own deadline of ${deadline} ms`;
  return {
    phase: 'unreachable',
    message:
      `Not reachable. If the server still runs, it stops the motors that this page turned by ${own}. ` +
      `If not, they ${isSeparate ? 'may keep' : 'keep'} turning, as those of other programs do: ` +
      'use the power switch or a guard. ' +
      `If the connection is back within ${AGAIN / 1000} s, the stop is sent again.`,
  };
}

/** The first of some names, and how many more there are. */
export function named(names: readonly string[]): string {
  const more = names.length - MOST_NAMED;
  return names.slice(0, MOST_NAMED).join(', ') + (more > 0 ? ` and ${more} more` : '');
}

/** Names in the order of lines and numbers. */
export const inOrder = (names: Iterable<string>) =>
  [...names].sort((a, b) => a.localeCompare(b, 'en', { numeric: true }));

function sorted(stopped: readonly StoppedMotor[]): Answered {
  // A search also asks addresses where no motor is. Their stop is sent, too.
  const isMotor = ({ line, motor, absent }: StoppedMotor) =>
    !absent || motors.value.get(line)?.includes(motor);
  const known = stopped.filter(isMotor);
  return { known, others: stopped.length - known.length };
}

function confirmed({ known, others }: Answered): StopReport {
  // The server repeats stops that failed.
  const later = confirmedSince();
  const isOpen = ({ line, motor, failure }: StoppedMotor) =>
    failure && !(motor === 0 ? [...later].some((name) => name.startsWith(`${line}/`)) : later.has(nameOf(line, motor)));
  const open = known.filter(isOpen);
  const failures = open.filter(({ motor }) => motor !== 0);
  const whole = open.filter(({ motor }) => motor === 0).map(({ line }) => line);
  const isLine = (name: string) => lines.value.some(({ line }) => line === name);
  const silent = whole.filter(isLine);
  // They have no line yet, or no more.
  const ports = whole.filter((name) => !isLine(name));
  const all = known.filter(({ motor }) => motor !== 0).length;
  const addresses = others === 1 ? 'address' : 'addresses';
  const note = others ? { note: `The stop also went to ${others} ${addresses} where no motor was found.` } : {};
  if (open.length) {
    const names = failures.map(({ line, motor }) => nameOf(line, motor));
    const turning = failures.length === 1 ? 'it may' : 'they may';
    const sentences = [
      ...(names.length ? [`${named(names)} did not confirm: ${turning} still be turning.`] : []),
      ...(silent.length ? [`Nothing has ever answered on ${named(silent)}: motors there may be turning.`] : []),
      ...(ports.length ? [`${named(ports)} is being opened or closed: motors there may be turning.`] : []),
      `${all - failures.length} of ${all} motors confirmed.`,
    ];
    return {
      phase: 'unconfirmed',
      message: sentences.join(' '),
      failures: open.map(({ line, motor, failure }) => `${nameOf(line, motor)}: ${failure}`),
      ...note,
    };
  }
  const message = all
    ? `Stopped: ${all} of ${all} motors confirmed.`
    : 'The server has it. No motor was read or commanded before.';
  return { phase: 'stopped', message, ...note };
}

/** Motion is refused while the share is latched, whatever else may be in its way. */
export function checkLatch() {
  if (latchedBy.value !== null) throw new Error('Motion is latched: press Release.');
}

/** Stops one motor. Without a connection that answers all motors are stopped, because only that has a second way. */
export async function stopMotor(line: string, motor: number): Promise<string> {
  if (state.value !== 'open') {
    stopAll();
    return 'There is no connection. Stop all was sent the second way.';
  }
  const { motors: stopped } = await ask({ ask: 'stop', motor: { line, motor } });
  const failed = stopped.find(({ failure }) => failure);
  if (failed) throw new Error(failed.absent ? `${failed.failure}.` : `${failed.failure}. It may still be turning.`);
  return 'Stopped: the motor confirmed it.';
}

/** Allows motion again. */
export async function release() {
  await ask({ ask: 'release' });
  stopReport.value = null;
}

const TEXT_FIELDS = new Set(['text', 'search', 'url', 'email', 'tel', 'password']);

/** Whether a space can be typed here. In a field of numbers it cannot. */
export function takesSpaces(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target.isContentEditable || target instanceof HTMLTextAreaElement) return true;
  return (
    target instanceof HTMLInputElement &&
    TEXT_FIELDS.has(target.type) &&
    !['numeric', 'decimal'].includes(target.inputMode)
  );
}

const isSpace = ({ code, key }: KeyboardEvent) => code === 'Space' || key === ' ';

/**
 * Esc always stops, Space unless it is typed into a text field. A focused control is not operated by
 * that Space: Enter does it, and toggles boxes, too.
 */
export function stopByKeys() {
  const down = (event: KeyboardEvent) => {
    const isTyped = isSpace(event) && takesSpaces(event.target);
    if (event.key === 'Escape' || (isSpace(event) && !isTyped)) {
      event.preventDefault();
      if (!event.repeat) stopAll();
    } else if (event.key === 'Enter' && event.target instanceof HTMLInputElement) {
      if (['checkbox', 'radio'].includes(event.target.type)) event.target.click();
    }
  };
  // Some browsers press a button when Space is released.
  const up = (event: KeyboardEvent) => {
    if (isSpace(event) && !takesSpaces(event.target)) event.preventDefault();
  };
  addEventListener('keydown', down, { capture: true });
  addEventListener('keyup', up, { capture: true });
}

/** Whether the server has the last stop. */
const isLatchedSince = () => entries.value.some(({ number, event }) => number > before && event === 'latched');

/** The motors that confirmed the last stop. A stop that failed is repeated: the last event of a motor counts. */
function confirmedSince(): Set<string> {
  const names = new Set<string>();
  for (const { number, event, line, motor } of entries.value) {
    if (number <= before || !line || motor == null) continue;
    if (event === 'stopped') names.add(nameOf(line, motor));
    if (event === 'stop-failed') names.delete(nameOf(line, motor));
  }
  return names;
}

/** Says which motors the server waits for. */
function waiting() {
  if (stopReport.peek()?.phase !== 'sent') return;
  const names = confirmedSince();
  const found = inOrder([...motors.peek()].flatMap(([line, all]) => all.map((motor) => nameOf(line, motor))));
  const missing = found.filter((name) => !names.has(name));
  const count = found.length - missing.length;
  if (found.length === 0 || (count === 0 && !isSlow)) return;
  // The server still asks addresses where no motor was found.
  stopReport.value =
    missing.length === 0
      ? { phase: 'stopped', message: `Stopped: ${count} of ${count} motors confirmed.` }
      : {
          phase: 'sent',
          message: `${WAITING} ${count} of ${found.length} did${isSlow ? `; not yet: ${named(missing)}` : '.'}`,
        };
}

let wasLatched = false;
latchedBy.subscribe((by) => {
  const phase = stopReport.peek()?.phase;
  // The latch comes before the stops, and the report of a stop ends with its latch.
  if (by !== null && phase === 'sent') {
    stopReport.value = { phase, message: WAITING };
  }
  if (by === null && wasLatched) stopReport.value = null;
  wasLatched = by !== null;
});
entries.subscribe(() => {
  waiting();
  if (lastAnswer && stopReport.peek()?.phase === 'unconfirmed') stopReport.value = confirmed(lastAnswer);
});

/** Sends a stop again that ended so. */
function sendAfter(phase: StopReport['phase']) {
  const isLate = performance.now() - pressedAt > AGAIN;
  if (stopReport.peek()?.phase === phase && !isLate) send();
}

welcome.subscribe((who) => {
  if (who) sendAfter('unreachable');
});
// The server has sent it before. This one has an answer, which says what the motors did.
shareLost.subscribe((why) => {
  if (why === null) sendAfter('refused');
});
