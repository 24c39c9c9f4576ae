// Small parts that views share.
import { useSignal, useSignalEffect } from '@preact/signals';
import { useCallback, useRef } from 'preact/hooks';
import { stopReport } from './stop';

export interface Sentence {
  tone: 'ok' | 'note' | 'bad';
  text: string;
}

const SIGNS = { ok: '✓ ', note: '', bad: '! ' } as const;

/** Carries out something, and keeps what there is to say about it: near the place where it was asked. */
export function useSaid() {
  const said = useSignal<Sentence | null>(null);
  const busy = useSignal(0);
  const last = useRef(0);
  const attempt = useCallback(async (what: () => Promise<string | Sentence | void>) => {
    last.current += 1;
    const number = last.current;
    // What was asked for last counts.
    const answer = (sentence: Sentence | null) => {
      if (number === last.current) said.value = sentence;
    };
    busy.value += 1;
    answer(null);
    try {
      const now = await what();
      answer(typeof now === 'string' ? { tone: 'ok', text: now } : (now ?? null));
    } catch (why) {
      answer({ tone: 'bad', text: (why as Error).message });
    } finally {
      busy.value -= 1;
    }
  }, []);
  const say = useCallback((sentence: Sentence | null) => {
    last.current += 1;
    said.value = sentence;
  }, []);
  // What was said before a stop is not true any more.
  useSignalEffect(() => {
    if (stopReport.value?.phase === 'sent') said.value = null;
  });
  return { said: said.value, attempt, say, isBusy: busy.value > 0 };
}

/** A sentence that is read aloud when it appears. */
export function Said({ said }: { said: Sentence | null }) {
  return (
    <p role="status" class={said ? `said ${said.tone}` : 'said'}>
      {said && `${SIGNS[said.tone]}${said.text}`}
    </p>
  );
}
