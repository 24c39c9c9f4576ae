// Gets the frames of a line from the share: those around an instant, or live.
import { computed, signal } from '@preact/signals';
import { Refused, ask, state } from '../link';
import type { WireFrame, WireLoad } from '../wire';
import { AROUND, MOST_KEPT, type Wanted, joined, sum } from './list';

const MOST = 1000;
const PAUSE = 200;
/** Frames after an instant that has just been are not there yet: the page asks for them again. */
const LATER = 1300;
const AGAIN = 3;
/** How many of the last answers the live load is about. */
const ANSWERS = 5;

export const frames = signal<readonly WireFrame[]>([]);
/** The times of the answers, the newest last. */
const loads = signal<readonly WireLoad[]>([]);
export const load = computed(() => sum(loads.value));
/** Frames between these are forgotten, or there are more than the page keeps. */
export const gaps = signal(0);
/** Why the share gives no frames. */
export const refused = signal<string | null>(null);
/** Whether no answer has come yet. */
export const isLoading = signal(true);
export const paused = signal(false);

function clear() {
  frames.value = [];
  loads.value = [];
  gaps.value = 0;
  refused.value = null;
  isLoading.value = true;
}

/** Gets frames until what this gives is called. */
export function follow({ line, t }: Wanted): () => void {
  clear();
  if (line === null) return () => {};
  let has_ended = false;
  const wait = (ms: number) => new Promise<void>((done) => setTimeout(done, ms));
  const run = async () => {
    for (let round = 0; !has_ended && (t === null || round < AGAIN); round += 1) {
      if (state.value === 'open' && !document.hidden && !(t === null && paused.value)) {
        try {
          if (t === null) await live(line, () => has_ended);
          else if (await around(line, t, () => has_ended)) return;
          refused.value = null;
        } catch (why) {
          if (!(why instanceof Refused)) throw why;
          if (!has_ended) refused.value = why.message;
        }
      } else if (t !== null) round -= 1;
      await wait(t === null ? PAUSE : LATER);
    }
  };
  void run();
  return () => void (has_ended = true);
}

/** Adds what came since the last time. */
async function live(line: string, hasEnded: () => boolean) {
  for (;;) {
    const after = frames.value.at(-1)?.number;
    const answer = await ask({ ask: 'frames', line, most: MOST, ...(after === undefined ? {} : { after }) });
    if (hasEnded()) return;
    isLoading.value = false;
    if (answer.missed) gaps.value += 1;
    frames.value = joined(frames.value, answer.frames);
    if (answer.frames.length > 0) loads.value = [...loads.value, answer.load].slice(-ANSWERS);
    if (!answer.more || paused.value) return;
  }
}

/** Gets the frames around an instant. Whether they are complete. */
async function around(line: string, t: number, hasEnded: () => boolean): Promise<boolean> {
  const [from, to] = [Math.max(0, t - AROUND), t + AROUND];
  let all: readonly WireFrame[] = [];
  const spans: WireLoad[] = [];
  for (;;) {
    const after = all.at(-1)?.number;
    const answer = await ask({ ask: 'frames', line, from, to, most: MOST, ...(after === undefined ? {} : { after }) });
    if (hasEnded()) return true;
    all = [...all, ...answer.frames];
    spans.push(answer.load);
    if (answer.more && answer.frames.length > 0 && all.length < MOST_KEPT) continue;
    isLoading.value = false;
    frames.value = all;
    loads.value = spans;
    if (all.length === 0 && answer.kept_since != null && to < answer.kept_since) {
      throw new Refused('usage', `The share keeps frames since ${answer.kept_since.toFixed(3)} s only. This instant is older.`);
    }
    const newest = await ask({ ask: 'frames', line, most: 1 });
    return hasEnded() || (newest.frames.at(-1)?.t ?? 0) > to;
  }
}
