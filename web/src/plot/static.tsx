// A plot of finished data: a step response, a recording.
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';

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
  /** Each value holds until the next one, as a reference does. */
  stepped?: boolean;
}

/** A dashed line with a text: a settling band, the time of a step. Give one of `t` and `value`. */
export interface Mark {
  label: string;
  t?: number;
  value?: number;
  /** The unit of `value`: that of a curve. */
  unit?: string;
}

export interface PlotProps {
  /** The accessible name, and the caption. */
  label: string;
  series: readonly Series[];
  marks?: readonly Mark[];
  /** Of the canvas, in CSS pixels. The width is that of the container. */
  height?: number;
  /** The user chose the instant `t`: a click on a curve, or Enter at the cursor. */
  onPick?: (t: number, series: Series) => void;
}

/** Draws finished data with zoom, cursors, a legend and a table behind. */
export function Plot({ label, series, height = 280 }: PlotProps) {
  const host = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const element = host.current!;
    const plot = new uPlot(
      {
        width: element.clientWidth,
        height,
        scales: { x: { time: false } },
        series: [{}, ...series.map(({ name, unit }) => ({ label: name, scale: `y ${unit}`, stroke: '#777' }))],
      },
      uPlot.join(series.map(({ t, values }) => [Float64Array.from(t), Float64Array.from(values)])),
      element,
    );
    return () => plot.destroy();
  }, [series, height]);
  return (
    <figure aria-label={label}>
      <div ref={host} />
      <figcaption>{label}</figcaption>
    </figure>
  );
}
