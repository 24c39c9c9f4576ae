// A plot of finished data: a step response, a recording.
import { useEffect, useMemo } from 'preact/hooks';
import type { Line, Trace } from './chart';
import { Figure } from './figure';
import { secondsClock } from './format';
import { Samples } from './samples';
import { Scheduler } from './scheduler';
import { styleOf } from './style';
import { Window } from './window';

/** A curve of finished data. Pass the same object again as long as the data are the same. */
export interface Series {
  /** Unique in the plot. The legend and the table show it. */
  name: string;
  /** The symbol of the unit; empty without one. Curves of the same unit share an axis. */
  unit: string;
  /** Ascending times in seconds, from any zero. */
  t: ArrayLike<number>;
  /** As many as `t`. NaN is no value: the curve has a gap there. */
  values: ArrayLike<number>;
  /** The number of its look, if it has to stay when other curves come. Otherwise it is its place. */
  look?: number;
  /** Each value holds until the next one, as a reference does. */
  stepped?: boolean;
}

/** A dashed line with a text: a settling band, the time of a step. Give one of `t` and `value`. */
export type Mark = Line;

export interface PlotProps {
  /** The accessible name, and the caption. */
  label: string;
  series: readonly Series[];
  marks?: readonly Mark[];
  /** Of the canvas, in CSS pixels. The width is that of the container. */
  height?: number;
  /** The user chose the instant `t`: a click on a curve, or Enter at the cursor. */
  onPick?: (t: number, series: Series) => void;
  /** What that does, for a button. */
  pickLabel?: string;
}

const LEAST_SPAN = 1e-4;

/** Draws finished data with zoom, cursors, a legend and a table behind. `series` and `marks`: see `Series`. */
export function Plot({ label, series, marks, height = 280, onPick, pickLabel }: PlotProps) {
  const traces = useMemo(() => series.map(traceOf), [series]);
  const [from, to] = useMemo(() => extent(traces), [traces]);
  const scheduler = useMemo(
    () => new Scheduler(new Window(to - from, false, Math.min(LEAST_SPAN, to - from), 10 * (to - from))),
    [from, to],
  );
  const home = () => {
    const margin = 0.01 * (to - from);
    scheduler.window.show(from - margin, to + margin);
    scheduler.request();
  };
  useEffect(home, [scheduler, traces]);
  return (
    <Figure
      label={label}
      traces={traces}
      scheduler={scheduler}
      clock={secondsClock}
      height={height}
      onHome={home}
      {...(marks && { marks })}
      {...(pickLabel && { pickLabel })}
      onPick={onPick && ((trace, x) => onPick(x, series.find(({ name }) => name === trace.key)!))}
    >
      <button type="button" onClick={home}>Show all</button>
    </Figure>
  );
}

function traceOf({ name, unit, t, values, look, stepped = false }: Series, index: number): Trace {
  const samples = new Samples();
  for (let at = 0; at < t.length; at += 1) {
    const value = values[at] ?? NaN;
    samples.push(t[at]!, isFinite(value) ? value : NaN);
  }
  return { key: name, name, unit, line: '', samples, style: styleOf(look ?? index), stepped, shown: true, old: false };
}

/** From the first to the last sample. */
function extent(traces: readonly Trace[]): [number, number] {
  const times = traces.flatMap(({ samples }) => [samples.oldest, samples.newest]).filter(isFinite);
  if (times.length === 0) return [0, 1];
  const from = Math.min(...times);
  const to = Math.max(...times);
  return to > from ? [from, to] : [from - 0.5, from + 0.5];
}
