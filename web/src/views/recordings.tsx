// Recordings: begin and end one, list them, download them, and look at them as plots.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { duration, sentence } from '../format';
import { type AnswerTo, ask, recorded, welcome } from '../link';
import { RecordButton, gapsText, isActive, missing, rateText } from '../record-button';
import { elapsed, fileOf, size } from '../recordings/part';
import { Replay } from '../recordings/replay';
import type { Recorded, RecordedSignal, RecordingContent, RecordingFile } from '../wire';
import './recordings.css';

const DATE = new Intl.DateTimeFormat('en-GB', { dateStyle: 'medium', timeStyle: 'medium' });
const LEAST_RATE = 0.1;
const MOST_RATE = 1000;
/** Signals that are drawn at first, and at most. */
const FIRST = 4;
const MOST = 16;

const nameInAddress = (): string | null => {
  const [, , name] = location.hash.split('/');
  try {
    return name ? decodeURIComponent(name) : null;
  } catch {
    return null;
  }
};

export default function Recordings() {
  const name = useSignal(nameInAddress());
  useEffect(() => {
    const follow = () => (name.value = nameInAddress());
    addEventListener('hashchange', follow);
    return () => removeEventListener('hashchange', follow);
  }, []);
  return name.value === null ? <List /> : <Opened key={name.value} name={name.value} />;
}

function List() {
  const list = useSignal<AnswerTo<'recordings'> | null>(null);
  const failure = useSignal<string | null>(null);
  const rate = useSignal('');
  const now = recorded.value;
  const isOn = isActive(now);
  const isConnected = welcome.value !== null;
  useEffect(() => {
    if (!isConnected) return;
    ask({ ask: 'recordings' }).then(
      (answer) => {
        list.value = answer;
        failure.value = null;
      },
      (why: Error) => (failure.value = why.message),
    );
  }, [isConnected, isOn]);
  const hertz = rate.value === '' ? null : Number(rate.value);
  const isRate = hertz === null || (hertz >= LEAST_RATE && hertz <= MOST_RATE);
  return (
    <div class="recordings">
      <h2>Recordings</h2>
      <section class="card" aria-label="The recording that is made">
        {welcome.value?.role === 'operator' && !isOn && (
          <label>
            Rate{' '}
            <input
              type="number" min={LEAST_RATE} max={MOST_RATE} step="any" placeholder="100" value={rate.value}
              onInput={({ currentTarget }) => (rate.value = currentTarget.value)}
            />{' '}
            Hz
          </label>
        )}
        {isRate ? <RecordButton rate={hertz} /> : <p class="bad">! A rate is {LEAST_RATE} to {MOST_RATE} Hz.</p>}
        {now && <Making recording={now} />}
      </section>
      {failure.value && <p class="bad" role="status">! {sentence(failure.value)}</p>}
      {list.value && (
        <>
          <p class="muted">In the folder {list.value.folder} of the computer with the server, the newest first.</p>
          {list.value.recordings.length === 0 && !isOn && <p>There is no recording yet.</p>}
          <ul class="recordings-list">
            {list.value.recordings.map((file) => <Item key={file.name} file={file} />)}
          </ul>
          {list.value.older > 0 && <p class="muted">{list.value.older} older ones are not listed.</p>}
        </>
      )}
    </div>
  );
}

/** The recording that is made, or how the last one ended. */
function Making({ recording }: { recording: Recorded }) {
  const { name, phase, by, seconds, bytes, values, motors, message } = recording;
  const lacks = missing(recording);
  return (
    <dl class="recordings-facts">
      <div><dt>File</dt><dd>{name || '–'}</dd></div>
      <div><dt>State</dt><dd>{phase}{phase === 'failed' && message && <span class="bad">: {message}</span>}</dd></div>
      <div><dt>Asked for by</dt><dd>{by}</dd></div>
      <div><dt>Time</dt><dd>{elapsed(seconds)}</dd></div>
      <div><dt>Size</dt><dd>{size(bytes)}</dd></div>
      <div><dt>Values</dt><dd>{values}</dd></div>
      <div><dt>Rate</dt><dd>{rateText(recording)}</dd></div>
      <div><dt>Missing</dt><dd>{lacks ? <strong class="bad">! {lacks}</strong> : 'nothing'}</dd></div>
      <div><dt>Motors</dt><dd>{motors.join(', ') || '–'}</dd></div>
    </dl>
  );
}

const SIGNS = { whole: '✓ whole', cut: '! not whole', unreadable: '✕ cannot be read' } as const;
const TONES = { whole: 'ok', cut: 'warn', unreadable: 'bad' } as const;

function Item({ file }: { file: RecordingFile }) {
  const { name, bytes, began, modified, seconds, motors, gaps, condition, message } = file;
  return (
    <li class="card">
      <h3>
        {condition === 'unreadable' ? name : <a href={`#/recordings/${encodeURIComponent(name)}`}>{name}</a>}
      </h3>
      <p>
        <span class={`chip ${TONES[condition]}`}>{SIGNS[condition]}</span> {DATE.format((began ?? modified) * 1000)},{' '}
        {seconds === null ? '' : `${duration(seconds)}, `}
        {size(bytes)}
      </p>
      {motors.length > 0 && <p class="muted">{motors.join(', ')}</p>}
      {gaps.length > 0 && <p class="bad">! {gapsText(gaps)}.</p>}
      {message && <p class="muted">{sentence(message)}</p>}
      <p>
        <a href={fileOf(name)} download={name}>Download<span class="hidden"> {name}</span></a>
      </p>
    </li>
  );
}

function Opened({ name }: { name: string }) {
  const content = useSignal<RecordingContent | null>(null);
  const failure = useSignal<string | null>(null);
  const chosen = useSignal<readonly number[]>([]);
  const isConnected = welcome.value !== null;
  useEffect(() => {
    if (!isConnected || content.value) return;
    ask({ ask: 'recording', name }).then(
      (answer) => {
        content.value = answer;
        chosen.value = firstOf(answer.signals);
        failure.value = null;
      },
      (why: Error) => (failure.value = why.message),
    );
  }, [isConnected]);
  const known = content.value;
  return (
    <div class="recordings">
      <p><a href="#/recordings">All recordings</a></p>
      <h2>{name}</h2>
      {failure.value && <p class="bad" role="status">! {sentence(failure.value)}</p>}
      {!known && !failure.value && <p class="muted">Reading …</p>}
      {known && (
        <>
          <p class="muted">
            Time 0 is {DATE.format(known.zero * 1000)}. {duration(known.seconds)}.{' '}
            <a href={fileOf(name)} download={name}>Download</a>
          </p>
          {known.damage && <p class="warn">! {sentence(known.damage)}</p>}
          <Choice signals={known.signals} chosen={chosen.value} onChange={(now) => (chosen.value = now)} />
          <Replay content={known} chosen={chosen.value} />
        </>
      )}
    </div>
  );
}

/** The first signals with a unit. */
export function firstOf(signals: readonly RecordedSignal[]): number[] {
  const numbers = [...signals.keys()].filter((number) => signals[number]!.unit !== '');
  const { motor } = signals[numbers[0] ?? 0] ?? {};
  return numbers.filter((number) => signals[number]!.motor === motor).slice(0, FIRST);
}

function Choice({ signals, chosen, onChange }: {
  signals: readonly RecordedSignal[];
  chosen: readonly number[];
  onChange: (chosen: readonly number[]) => void;
}) {
  const motors = [...new Set(signals.map(({ motor }) => motor))];
  const isFull = chosen.length >= MOST;
  return (
    <details class="recordings-choice">
      <summary>Signals: {chosen.length} of {signals.length}, at most {MOST}</summary>
      {motors.map((motor) => (
        <fieldset key={motor}>
          <legend>{motor}</legend>
          {signals.map(({ motor: of, name, unit, doc }, number) => of === motor && (
            <label key={number} title={doc}>
              <input
                type="checkbox"
                checked={chosen.includes(number)}
                disabled={isFull && !chosen.includes(number)}
                onChange={({ currentTarget: { checked } }) =>
                  onChange(checked ? [...chosen, number] : chosen.filter((one) => one !== number))}
              />{' '}
              {name}{unit && <small class="muted"> {unit}</small>}
            </label>
          ))}
        </fieldset>
      ))}
    </details>
  );
}
