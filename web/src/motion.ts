// What a card says about a motion of this page, for as long as it is true.
import { useSignal, useSignalEffect } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { decimalsOf, nameOf, number, sentence } from './format';
import { type Entry, entries, lapsed, rans, state, welcome } from './link';
import { type Live, liveOf } from './overview';
import type { Sentence } from './parts';
import type { Description, RunResult } from './wire';

/** Events of a motor after which the page that turned it does not run it any more. */
const ENDS: ReadonlySet<string> = new Set(['stopping', 'stopped', 'stop-failed', 'silent']);
/** The same for all motors of a line. */
const LINE_ENDS: ReadonlySet<string> = new Set(['lost', 'closed']);
/** States of an ST drive in which its motor does not run. */
const AT_REST = /^(IDLE|FAULT)/;

/** A day, in seconds. */
const LONGEST = 86_400;

/** Whether a program is the page, or the server for it. */
const isOwn = (by: string | null | undefined, own: string | undefined) =>
  own !== undefined && (by === own || by?.startsWith(`${own} (`) === true);

/** The first event after the entry `since` that ends a motion of the page `own`. */
export function endOf(all: readonly Entry[], since: number, line: string, motor: number, own: string | undefined) {
  return all.find((one) => {
    if (one.number <= since || one.line !== line) return false;
    if (one.motor == null) return LINE_ENDS.has(one.event);
    return one.motor === motor && (ENDS.has(one.event) || (one.event === 'commanded' && !isOwn(one.by, own)));
  });
}

/** What the end of the references that the server sent came to. */
export function endOfReferences({ reference, failure }: RunResult, unit: string): Sentence {
  const at = `${number(reference, decimalsOf(unit))} ${unit}`;
  return failure == null
    ? { tone: 'ok', text: `Running. The reference has reached ${at}.` }
    : { tone: 'bad', text: sentence(`the reference got no further than ${at}: ${failure}`) };
}

/** The name of the state, if it was read in the last second and since a motion began: so many seconds ago. */
export function stateSince(live: Pick<Live, 'age' | 'values'>, { overview, states }: Description, begun: number) {
  if (overview.state === null || !(live.age(overview.state) < Math.min(1, begun))) return undefined;
  const value = live.values.get(overview.state)?.value;
  return states.find((one) => one.value === value)?.name;
}

/** Follows a motion, and says what ended it. `unit` is that of its reference. */
export function useMotion(
  line: string,
  motor: number,
  description: Description,
  unit: string,
  say: (now: Sentence | null) => void,
) {
  const since = useSignal<number | null>(null);
  const isStreamed = useSignal(false);
  const hasRun = useRef(false);
  /** When the motion began, in ms. */
  const begun = useRef(0);
  const arrival = useRef<ReturnType<typeof setTimeout> | undefined>(undefined);
  const forget = () => {
    clearTimeout(arrival.current);
    since.value = null;
    hasRun.current = false;
  };
  const end = (now: Sentence | null) => {
    forget();
    say(now);
  };

  useSignalEffect(() => {
    if (since.value === null) return;
    const event = endOf(entries.value, since.value, line, motor, welcome.value?.name);
    if (event) return end({ tone: 'note', text: sentence(event.message.replace(/^\S+, motor \d+: /, '')) });
    // The page says above what happened.
    if (state.value === 'lost' || lapsed.value !== null) return end(null);
    const live = liveOf(line, motor);
    void live.tick.value;
    const name = stateSince(live, description, (performance.now() - begun.current) / 1000);
    if (name === undefined) return;
    if (!AT_REST.test(name)) hasRun.current = true;
    else if (hasRun.current) end({ tone: 'note', text: `The motor does not run any more: ${name}.` });
  });
  useSignalEffect(() => {
    const ran = isStreamed.value ? rans.value.get(nameOf(line, motor)) : undefined;
    if (!ran) return;
    isStreamed.value = false;
    // It comes after the events of the stop, and is worth more: it has the reason.
    if (ran.failure != null) forget();
    say(endOfReferences(ran, unit));
  });
  useEffect(() => () => clearTimeout(arrival.current), []);

  const began = () => {
    begun.current = performance.now();
    since.value = entries.value.at(-1)?.number ?? 0;
  };
  return {
    /** Something else is asked of the motor. */
    forget() {
      forget();
      isStreamed.value = false;
      const rest = new Map(rans.value);
      if (rest.delete(nameOf(line, motor))) rans.value = rest;
    },
    /** The motor runs from now on. The server says when its reference is at the target. */
    begin() {
      began();
      isStreamed.value = true;
    },
    /** The drive goes to the target by itself. It does not say when it is there. */
    beginAlone(seconds: number, to: string) {
      began();
      const over: Sentence = { tone: 'ok', text: `Running to ${to}. The ramp took ${number(seconds, 1)} s.` };
      // Longer times are none for a timer.
      if (seconds < LONGEST) arrival.current = setTimeout(() => say(over), 1000 * seconds);
    },
  };
}
