// The button that scans a port, and what answered at each rate.
import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { Said, useSaid } from '../parts';
import { Confirm } from '../registers/confirm';
import { isDrive, rateText, scan, type Scanned, type Wanted } from './scan';

/** `wanted` gives the port of the form. `use` takes the port at the rate that was found. */
export function Scan({ wanted, isReady, use }: {
  wanted: () => Wanted;
  isReady: boolean;
  use: (port: string) => void;
}) {
  const answers = useSignal<readonly Scanned[]>([]);
  const protocol = useSignal<Wanted['protocol']>('st');
  const left = useSignal(0);
  const question = useSignal<((may: boolean) => void) | null>(null);
  const { said, attempt, isBusy } = useSaid();
  const isEnded = useRef(false);
  const end = () => {
    isEnded.current = true;
    question.value?.(false);
  };
  useEffect(() => end, []);
  const begin = () =>
    attempt(async () => {
      const one = wanted();
      answers.value = [];
      protocol.value = one.protocol;
      isEnded.current = false;
      return scan(one, {
        found: (answer, rest) => {
          answers.value = [...answers.value, answer];
          left.value = rest;
          if (isDrive(answer)) use(answer.port);
        },
        mayDisturb: () =>
          new Promise((done) => {
            question.value = (may) => {
              question.value = null;
              done(may);
            };
          }),
        isEnded: () => isEnded.current,
      });
    });
  return (
    <>
      {isBusy ? (
        <button type="button" onClick={end}>
          End the scan
        </button>
      ) : (
        <button type="button" disabled={!isReady} onClick={() => void begin()}>
          Scan
        </button>
      )}
      <div class="wide scan">
        {isBusy && (
          <p class="muted">
            Asking what answers … {left.value > 0 && `${left.value} rates are left`}
          </p>
        )}
        <ul aria-label="What answered">
          {answers.value.map((answer) => (
            <li key={answer.port} class={isDrive(answer) ? 'ok' : undefined}>
              {answer.rate != null && <span class="rate">{rateText(answer.rate, protocol.value)}</span>}
              <span>{answer.text}</span>
            </li>
          ))}
        </ul>
        <Said said={said} />
      </div>
      {question.value && (
        <Confirm title="Try other bit rates?" action="Try them" onDone={question.value}>
          <p>
            No motor answered at the bit rate of the adapter. At a wrong bit rate the adapter disturbs the bus. If
            another program turns motors on this bus, they may lose their commands: stop them first.
          </p>
        </Confirm>
      )}
    </>
  );
}
