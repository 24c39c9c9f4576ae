// Small parts that views share.
import { useSignal, useSignalEffect } from '@preact/signals';
import { useCallback, useRef } from 'preact/hooks';
import { stopReport } from './stop';

export interface Sentence {
  tone: 'ok' | 'bad';
  text: string;
}

/** Carries out something, and keeps what there is to say about it: near the place where it was asked. */
export function useSaid() {
  const said = useSignal<Sentence | null>(null);
  const busy = useSignal(0);
  const last = useRef(0);
  const attempt = useCallback(async (what: () => Promise<string | void>) => {
    last.current += 1;
    const number = last.current;
    // What was asked for last counts.
    const say = (sentence: Sentence | null) => {
      if (number === last.current) said.value = sentence;
    };
    busy.value += 1;
    say(null);
    try {
      const text = await what();
      say(text ? { tone: 'ok', text } : null);
    } catch (why) {
      say({ tone: 'bad', text: (why as Error).message });
    } finally {
      busy.value -= 1;
    }
  }, []);
  // What was said before a stop is not true any more.
  useSignalEffect(() => {
    if (stopReport.value?.phase === 'sent') said.value = null;
  });
  return { said: said.value, attempt, isBusy: busy.value > 0 };
}

/** A sentence that is read aloud when it appears. */
export function Said({ said }: { said: Sentence | null }) {
  return (
    <p role="status" class={said ? `said ${said.tone}` : 'said'}>
      {said && `${said.tone === 'ok' ? '✓' : '!'} ${said.text}`}
    </p>
  );
}
