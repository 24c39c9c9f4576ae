// What an experiment needs, of this page; and what ends it.
import { effect } from '@preact/signals';
import { ask, events, lapsed, latchedBy, state, subscribe, welcome } from '../link';
import { stopMotor } from '../stop';
import type { MotorName } from '../wire';
import type { Rig } from './experiment';

export const rig: Rig = {
  ask,
  // Rows that are confirmed come seconds late if they are asked for faster than the line carries them.
  subscribe: (signals, period, onRows, onRefused) => subscribe(signals, period, onRows, { onRefused }),
  stop: ({ line, motor }) => stopMotor(line, motor),
  events: () => events.value,
  name: () => welcome.value?.name ?? '',
  wait: (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds)),
};

const STOPS = new Set(['stopping', 'stopped', 'stop-failed']);

/** Calls `abort` with the reason when something else than the experiment ends it. Returns what ends the watch. */
export function watch({ line, motor }: MotorName, abort: (why: string) => void): () => void {
  // A notice of an earlier motion is not about this one.
  lapsed.value = null;
  const known = events.peek().at(-1);
  const onHidden = () => {
    if (document.hidden) abort('The tab was hidden.');
  };
  document.addEventListener('visibilitychange', onHidden);
  const ends = [
    effect(() => {
      if (latchedBy.value !== null) abort(`All motors were stopped by ${latchedBy.value}.`);
    }),
    effect(() => {
      if (lapsed.value !== null) abort(`The server stopped the motors of this page: ${lapsed.value}`);
    }),
    effect(() => {
      if (state.value !== 'open') abort('The connection to the server was lost.');
    }),
    effect(() => {
      const all = events.value;
      const young = all.slice(known ? all.lastIndexOf(known) + 1 : 0);
      const stop = young.find(
        (one) => STOPS.has(one.event) && (one.line ?? line) === line && (one.motor ?? motor) === motor,
      );
      if (stop) abort(stop.message);
    }),
  ];
  return () => {
    document.removeEventListener('visibilitychange', onHidden);
    ends.forEach((end) => end());
  };
}
