// Stop all: by WebSocket, by HTTP if that does not answer in time, and what is known of it.
import { signal } from '@preact/signals';
import { nameOf } from './format';
import { Refused, ask, entries, held, lastWelcome, latchedBy, motors, sayAlive, shareLost, state, welcome } from './link';
import type { StoppedMotor } from './wire';

export interface StopReport {
  /** `stopped`: every motor that was found confirmed it. `refused`: the server answers, but cannot stop them now. */
  phase: 'sent' | 'stopped' | 'unconfirmed' | 'refused' | 'unreachable';
  message: string;
  /** Each motor that did not confirm, and why. */
  failures?: readonly string[];
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

let last = 0;
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
    tell(confirmed(stopped));
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
    if (isOver || isLatchedSince()) return;
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
  const deadline = lastWelcome.value?.deadline;
  const own = deadline === undefined ? 'its own deadline' : `its own deadline of ${deadline} ms`;
  return {
    phase: 'unreachable',
    message:
      `Not reachable. The server stops the motors that this page turned by ${own}; others turn on. ` +
      `If the connection is back within ${AGAIN / 1000} s, the stop is sent again.`,
  };
}

export { nameOf };

function confirmed(stopped: readonly StoppedMotor[]): StopReport {
  // A search also asks addresses where no motor is. Their stop is sent, too.
  const isMotor = ({ line, motor, absent }: StoppedMotor) =>
    !absent || motors.value.get(line)?.includes(motor);
  const known = stopped.filter(isMotor);
  const failures = known.filter(({ failure }) => failure);
  const others = stopped.length - known.length;
  const silent = others
    ? ` The stop also went to ${others} ${others === 1 ? 'address' : 'addresses'} where no motor was found.`
    : '';
  if (failures.length) {
    const names = failures.slice(0, MOST_NAMED).map(({ line, motor }) => nameOf(line, motor));
    const more = failures.length - names.length;
    const turning = failures.length === 1 ? 'it may' : 'they may';
    return {
      phase: 'unconfirmed',
      message:
        `${names.join(', ')}${more ? ` and ${more} more` : ''} did not confirm: ${turning} still be turning. ` +
        `${known.length - failures.length} of ${known.length} motors confirmed.${silent}`,
      failures: failures.map(({ line, motor, failure }) => `${nameOf(line, motor)}: ${failure}`),
    };
  }
  const count = known.length;
  const message = count
    ? `Stopped: ${count} of ${count} motors confirmed.${silent}`
    : `The server has it. No motor was read or commanded before.${silent}`;
  return { phase: 'stopped', message };
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

/** The motors that confirmed the last stop, while the server waits for others. */
const confirmedSince = () =>
  new Set(
    entries.value.flatMap(({ number, event, line, motor }) =>
      number > before && event === 'stopped' && line && motor != null ? [nameOf(line, motor)] : [],
    ),
  );

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
  if (stopReport.peek()?.phase !== 'sent') return;
  const names = confirmedSince();
  if (!names.size) return;
  const found = [...motors.peek()].flatMap(([line, all]) => all.map((motor) => nameOf(line, motor)));
  const count = found.filter((name) => names.has(name)).length;
  // The server still asks addresses where no motor was found.
  stopReport.value =
    count === found.length
      ? { phase: 'stopped', message: `Stopped: ${count} of ${count} motors confirmed.` }
      : { phase: 'sent', message: `${WAITING} ${count} of ${found.length} did.` };
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
