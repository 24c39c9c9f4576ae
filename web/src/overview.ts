// The values on the cards: the last of each signal, and a short history of the speed.
import { type Signal, signal } from '@preact/signals';
import { descriptions, shownMotors } from './drives';
import { nameOf, tooOld } from './format';
import { type Rows, age, state, wallAt } from './link';
import { follow } from './subscriptions';
import type { Overview, SignalName } from './wire';

/** How often the values of the cards are read, in seconds. */
const FAST = 0.1;
const SLOW = 0.5;
/** How often cards are drawn, in ms. */
const DRAW = 100;
/** Cards that are not in view are drawn each `OUT_OF_VIEW`th time. */
const OUT_OF_VIEW = 10;
/** For so long a card may be without a value, in ms. */
const NEW = 1500;
/** Points of the history of a card: one each `DRAW`. */
export const HISTORY = 200;

export interface Last {
  value: number;
  unit: string;
  /** When it was read, by the wall clock in seconds. */
  wall: number;
}

export class Live {
  /** The last value of each signal, by name. */
  readonly values = new Map<string, Last>();
  readonly history = new Float64Array(HISTORY).fill(NaN);
  /** Counts the drawings of the card. */
  readonly tick = signal(0);
  isInView = true;
  lost = 0;
  /** When it was made, in ms. */
  private readonly since = performance.now();

  /** How old the value of a signal is, in seconds. */
  age(name: string): number {
    const last = this.values.get(name);
    return last ? age(last.wall) : NaN;
  }

  /** Whether a value of the last second is there, or may come: the card is new. */
  isHeard(name: string): boolean {
    return this.age(name) < 1 || performance.now() - this.since < NEW;
  }

  /** Why the value of a signal is not live, or null. */
  old(name: string): string | null {
    return tooOld(this.age(name)) ?? (state.value === 'lost' ? 'not live' : null);
  }
}

const lives = new Map<string, Live>();

export function liveOf(line: string, motor: number): Live {
  const name = nameOf(line, motor);
  const known = lives.get(name) ?? new Live();
  lives.set(name, known);
  return known;
}

/** Draws a card often while it is in view or near to it. Returns what ends that. */
export function watchView(card: Element, live: Live): () => void {
  const seen = (entries: IntersectionObserverEntry[]) => (live.isInView = entries.at(-1)!.isIntersecting);
  const observer = new IntersectionObserver(seen, { rootMargin: '50%' });
  observer.observe(card);
  return () => {
    observer.disconnect();
    live.isInView = true;
  };
}

/** Why there are no values, or null. */
export const overviewRefused: Signal<string | null> = signal(null);

function take({ line, motor, columns, t0, t, values, lost }: Rows) {
  const live = liveOf(line, motor);
  live.lost += lost;
  const row = t.length - 1;
  if (row < 0) return;
  const wall = wallAt(line, t0 + t[row]!);
  columns.forEach(({ name, unit }, at) => {
    live.values.set(name, { value: values[at]![row]!, unit, wall });
  });
}

const fastOf = ({ state, faults, speed, current, angle }: Overview) => [state, faults, speed, current, angle];
const slowOf = ({ temperature, voltage }: Overview) => [temperature, voltage];

/** Reads what the cards show. Returns what ends it. */
export function watchOverview(): () => void {
  const stopReading = follow(
    () => {
      const known = descriptions.value;
      const names = (pick: (overview: Overview) => (string | null)[]): SignalName[] =>
        shownMotors.value.flatMap(({ line, motor }) => {
          const overview = known.get(line)?.overview;
          const wanted = overview ? pick(overview).filter((name) => name !== null) : [];
          return wanted.map((name) => ({ line, motor, name }));
        });
      return [
        { signals: names(fastOf), period: FAST },
        { signals: names(slowOf), period: SLOW },
      ];
    },
    take,
    (why) => void (overviewRefused.value = why && why.message),
  );

  let turn = 0;
  const timer = setInterval(() => {
    turn += 1;
    for (const { line, motor } of shownMotors.peek()) {
      const live = liveOf(line, motor);
      const speed = descriptions.peek().get(line)?.overview.speed;
      const last = speed === undefined ? undefined : live.values.get(speed);
      live.history.copyWithin(0, 1);
      // An old value is a gap in the history.
      live.history[HISTORY - 1] = last && age(last.wall) < 1 ? last.value : NaN;
      if (live.isInView || turn % OUT_OF_VIEW === 0) live.tick.value += 1;
    }
  }, DRAW);
  return () => {
    stopReading();
    clearInterval(timer);
  };
}
