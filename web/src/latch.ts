// What is said of the latch: who pressed the stop, and which motors have not confirmed it.
import { computed, signal } from '@preact/signals';
import { nameOf } from './format';
import { entries, latchedBy, lines, linesAt, motors } from './link';
import { inOrder, named } from './stop';

/** For so long, in ms, motors that did not confirm are not named: most confirm within it. */
const FRESH = 1000;

/** The first event of the last latch. */
let latchedAt = 0;
let seen = 0;
let timer: ReturnType<typeof setTimeout> | undefined;
/** Whether the stop was pressed just now. */
const isFresh = signal(false);

entries.subscribe((all) => {
  const latched = all.find(({ number, event }) => number > seen && event === 'latched');
  seen = all.at(-1)?.number ?? seen;
  // Each line has an event of the same latch.
  if (!latched || isFresh.peek()) return;
  latchedAt = latched.number;
  isFresh.value = true;
  clearTimeout(timer);
  timer = setTimeout(() => (isFresh.value = false), FRESH);
});

/** Motors that have not confirmed their last stop, by name: they may be turning. */
export const unstopped = computed<readonly string[]>(() => {
  const names = new Set(lines.value.flatMap(({ line, unstopped }) => (unstopped ?? []).map((motor) => nameOf(line, motor))));
  for (const { number, event, line, motor } of entries.value) {
    if (number <= linesAt.value || !line || motor == null) continue;
    const isKnown = motors.value.get(line)?.includes(motor);
    if (event === 'stopped') names.delete(nameOf(line, motor));
    else if (isKnown && (event === 'stopping' || event === 'stop-failed')) names.add(nameOf(line, motor));
  }
  return inOrder(names);
});

/** Whether an event of this kind came after the latch. */
const since = (kind: string) => entries.value.some(({ number, event }) => number > latchedAt && event === kind);

/** Whether a stop came with the latch; `null`: the page is newer, or the events since the latch are not kept. */
function isStop(): boolean | null {
  if (isFresh.value || ['stopping', 'stopped', 'stop-failed'].some(since)) return true;
  const areKept = entries.value.some(({ number }) => number === latchedAt) && !since('later');
  return areKept ? false : null;
}

/** Who stopped the motors, and what is known of it. `null`: there is no latch. */
export const latchText = computed<string | null>(() => {
  const by = latchedBy.value;
  if (by === null) return null;
  const open = unstopped.value;
  if (isFresh.value && (open.length ? !since('stop-failed') : !since('stopped'))) return `Stop pressed by ${by}.`;
  if (open.length > 0) return `Stop of all by ${by}. Not confirmed, may be turning: ${named(open)}.`;
  const isStopped = isStop();
  if (isStopped === null) return `Latched by ${by}.`;
  // A program can latch motion without a stop: then motors keep turning.
  return isStopped ? `Stopped by ${by}.` : `Latched by ${by}, without a stop.`;
});
