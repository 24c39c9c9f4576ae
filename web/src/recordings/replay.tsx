// The plot of a recording. Zooming asks the server for more points.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import type { Line, Trace } from '../plot/chart';
import { Figure } from '../plot/figure';
import { secondsClock } from '../plot/format';
import { Samples } from '../plot/samples';
import { Scheduler } from '../plot/scheduler';
import { styleOf } from '../plot/style';
import { Window } from '../plot/window';
import type { RecordedEvent, RecordingContent } from '../wire';
import { type Part, type Points, ask, finer, splice } from './part';

/** Of each signal. The server keeps the least and the greatest value of each stretch of time. */
const POINTS = 6000;
const LEAST_SPAN = 1e-4;
const QUIET = 150;
/** Lines of more events would cover the curves. */
const MOST_MARKS = 500;

export function Replay({ content, chosen }: { content: RecordingContent; chosen: readonly number[] }) {
  const { name, signals, seconds } = content;
  const whole = useSignal<Part | null>(null);
  const detail = useSignal<Part | null>(null);
  const failure = useSignal<string | null>(null);
  const reading = useSignal(false);
  const asked = useRef<AbortController | null>(null);
  const scheduler = useMemo(() => {
    const span = Math.max(seconds, LEAST_SPAN);
    const window = new Window(span, false, LEAST_SPAN, 2 * span);
    window.show(-0.01 * span, 1.01 * span);
    return new Scheduler(window);
  }, [name, seconds]);

  const load = async (range: { from: number; to: number }, into: typeof whole) => {
    asked.current?.abort();
    const control = new AbortController();
    asked.current = control;
    reading.value = true;
    try {
      into.value = await ask(name, chosen, range, POINTS, control.signal);
      failure.value = null;
    } catch (why) {
      if (!control.signal.aborted) failure.value = (why as Error).message;
    }
    if (asked.current === control) reading.value = false;
  };

  useEffect(() => {
    whole.value = null;
    detail.value = null;
    if (chosen.length > 0) void load({ from: 0, to: seconds }, whole);
    return () => asked.current?.abort();
  }, [name, chosen]);

  // What is shown changes while the user zooms. The server is asked when that is over.
  useEffect(() => {
    let seen = scheduler.window.version;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const look = () => {
      const range = whole.value && finer(scheduler.window, seconds, detail.value?.head ?? null);
      if (range) void load(range, detail);
    };
    const remove = scheduler.add({
      visible: true,
      draw: () => {
        if (scheduler.window.version === seen) return;
        seen = scheduler.window.version;
        clearTimeout(timer);
        timer = setTimeout(look, QUIET);
      },
      write: () => {},
    });
    return () => {
      remove();
      clearTimeout(timer);
    };
  }, [scheduler, chosen]);

  const [all, part] = [whole.value, detail.value];
  const shown = useRef(new Map<string, boolean>());
  const traces = useMemo(
    () =>
      chosen.map((number, index): Trace => {
        const { motor, name: signal, unit } = signals[number]!;
        const key = `${motor}/${signal}`;
        const trace = {
          key, name: key, unit, line: '', samples: samplesOf(number, all, part), style: styleOf(index),
          stepped: false, old: false, shown: true,
        };
        // A curve that is hidden stays hidden when there are more points.
        return Object.defineProperty(trace, 'shown', {
          get: () => shown.current.get(key) ?? true,
          set: (value: boolean) => void shown.current.set(key, value),
        });
      }),
    [signals, chosen, all, part],
  );
  const marks = useMemo(() => marksOf(all?.head.events ?? []), [all]);
  const home = () => {
    scheduler.window.show(-0.01 * seconds, 1.01 * seconds);
    scheduler.request();
  };
  const damage = part?.head.damage ?? all?.head.damage ?? null;

  if (chosen.length === 0) return <p class="muted">Choose signals to draw them.</p>;
  return (
    <>
      <p role="status" class={failure.value ? 'bad' : 'muted'}>
        {failure.value ? `! ${failure.value}` : reading.value ? 'Reading …' : damage ? `The file is not whole: ${damage}` : ''}
      </p>
      <Figure
        label={`Signals of ${name}`}
        traces={traces}
        scheduler={scheduler}
        clock={secondsClock}
        height={340}
        marks={marks}
        onHome={home}
      >
        <button type="button" onClick={home}>Show all</button>
      </Figure>
      {all && <EventsOf events={all.head.events} more={all.head.more_events} />}
    </>
  );
}

function EventsOf({ events, more }: { events: readonly RecordedEvent[]; more: number }) {
  if (events.length === 0) return null;
  return (
    <details class="recording-events">
      <summary>{events.length + more} events</summary>
      <ul>
        {events.map(({ t, of, by, message }) => (
          <li>
            <span class="mono">{secondsClock.full(t)}</span> {of}: {message}
            {by && <span class="muted"> by {by}</span>}
          </li>
        ))}
        {more > 0 && <li class="muted">and {more} more: `motorlink info --events` prints all</li>}
      </ul>
    </details>
  );
}

function samplesOf(number: number, all: Part | null, part: Part | null): Samples {
  const samples = new Samples();
  const whole = all?.points.get(number);
  const fine = part?.points.get(number);
  const points: Points | undefined = whole && fine && part ? splice(whole, fine, part.head) : whole;
  for (let at = 0; at < (points?.t.length ?? 0); at += 1) {
    const value = points!.values[at]!;
    samples.push(points!.t[at]!, isFinite(value) ? value : NaN);
  }
  return samples;
}

/** The first events have a line in the plot. All of them are in the list. */
function marksOf(events: readonly RecordedEvent[]): Line[] {
  const told = events.filter(({ kind }) => !['joined', 'left', 'absent_settings'].includes(kind));
  return told.slice(0, MOST_MARKS).map(({ t, kind, of }) => ({ t, label: `${kind} ${of}` }));
}
