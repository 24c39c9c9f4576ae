// A plot with what belongs to it: legend with values, cursors, keyboard, announcements, table.
import type { ComponentChildren } from 'preact';
import { useEffect, useId, useMemo, useRef, useState } from 'preact/hooks';
import { Chart, type Line, type Trace } from './chart';
import { type Clock, duration, value, withUnit } from './format';
import { HELP, press } from './keys';
import { between, valueAt } from './readings';
import type { Panel, Scheduler } from './scheduler';
import { Table } from './table';
import './plot.css';
import 'uplot/dist/uPlot.min.css';

export interface FigureProps {
  label: string;
  traces: readonly Trace[];
  scheduler: Scheduler;
  clock: Clock;
  height: number;
  marks?: readonly Line[];
  /** Whether the curves grow, so that the newest values are worth a column. */
  live?: boolean;
  /** The instant at cursor A was chosen. The curve is the one that was clicked last, or the first. */
  onPick?: ((trace: Trace, x: number) => void) | undefined;
  /** What choosing does, for a button: "Show the wire". */
  pickLabel?: string;
  /** Shows everything, or follows the newest values again. */
  onHome: () => void;
  /** The state of a curve beside its name, such as its rate. Empty if there is nothing to say. */
  note?: (trace: Trace) => string;
  /** The newest value as text, and how old it is if it is too old. */
  newest?: (trace: Trace) => { text: string; old: string };
  children?: ComponentChildren;
}

const ANNOUNCE = 500;
const MOST_ANNOUNCED = 8;
const EDGE = 5;

export function Figure(props: FigureProps) {
  const { label, traces, scheduler, height, marks = NO_MARKS, live = false, pickLabel, children } = props;
  const { window } = scheduler;
  const id = useId();
  const latest = useRef(props);
  latest.current = props;
  const host = useRef<HTMLDivElement>(null);
  const legend = useRef<HTMLTableElement>(null);
  const reading = useRef<HTMLParagraphElement>(null);
  const picker = useRef<HTMLButtonElement>(null);
  const finder = useRef<HTMLButtonElement>(null);
  const announcer = useRef<HTMLParagraphElement>(null);
  const [hidden, setHidden] = useState<readonly string[]>([]);
  const [, redraw] = useState(0);
  const hover = useRef<number | null>(null);
  const clicked = useRef<Trace | null>(null);

  const actions = useMemo(() => {
    const shown = () => latest.current.traces.filter((trace) => trace.shown);
    return {
      step: (x: number, direction: 1 | -1) => {
        const times = shown().map(({ samples }) => {
          const at = samples.at(x);
          const number = direction < 0 ? at - 1 : samples.x(Math.min(at, samples.end - 1)) === x ? at + 1 : at;
          return number >= samples.first && number < samples.end ? samples.x(number) : NaN;
        }).filter(isFinite);
        if (times.length === 0) return x;
        return direction < 0 ? Math.max(...times) : Math.min(...times);
      },
      oldest: () => Math.min(...shown().map(({ samples }) => samples.oldest).filter(isFinite)),
      home: () => latest.current.onHome(),
      pick: (x: number) => {
        const all = shown();
        const trace = all.find((one) => one === clicked.current) ?? all[0];
        if (trace) latest.current.onPick?.(trace, x);
      },
    };
  }, []);

  useEffect(() => {
    const changed = () => scheduler.request();
    const chart = new Chart(host.current!, traces, {
      clock: props.clock,
      height,
      marks,
      live,
      events: {
        onSelect: (min, max) => (window.show(min, max), changed()),
        onPlace: (x, second, trace) => {
          if (trace) clicked.current = trace;
          window[second ? 'b' : 'a'] = x;
          changed();
          announce();
        },
        onZoom: (factor, x) => (window.zoom(factor, x), changed()),
        onPan: (share) => (window.pan(share), changed()),
        onHome: () => (latest.current.onHome(), changed()),
        onHover: (x) => {
          hover.current = x;
          // Numbers only: the curves stay as they are.
          scheduler.sampled();
        },
      },
    });
    chart.onStale = () => {
      setHidden(chart.hidden);
      scheduler.request();
    };
    setHidden(chart.hidden);
    const panel: Panel = {
      visible: true,
      draw: () => {
        const { min, max, a, b } = window;
        chart.draw(min, max);
        chart.place(a, b);
      },
      write: () => write(),
    };
    const seen = new IntersectionObserver(([entry]) => {
      panel.visible = entry!.isIntersecting;
      if (!panel.visible) return;
      panel.write();
      scheduler.request();
    });
    seen.observe(host.current!);
    const remove = scheduler.add(panel);
    return () => {
      remove();
      seen.disconnect();
      chart.destroy();
    };
  }, [traces, marks, height, scheduler, props.clock]);

  const write = () => {
    const { min, max, a, b } = window;
    const near = (EDGE * (max - min)) / Math.max(host.current?.clientWidth ?? 1, 1);
    const { newest, note } = latest.current;
    const first = a ?? hover.current;
    for (const row of legend.current?.tBodies[0]?.rows ?? []) {
      const trace = latest.current.traces.find(({ key }) => key === row.dataset.key);
      if (!trace) continue;
      const { samples, stepped } = trace;
      const { min: low, max: high } = samples.extremes(samples.at(min), samples.at(max));
      const any = low <= high;
      const at = (x: number | null) => (x === null ? NaN : valueAt(samples, x, near, stepped));
      const of: Record<string, string> = {
        least: any ? value(low) : '–',
        most: any ? value(high) : '–',
        a: first === null ? '' : value(at(first)),
        b: b === null ? '' : value(at(b)),
        change: a === null || b === null ? '' : value(at(b) - at(a)),
      };
      if (newest) {
        const { text, old } = newest(trace);
        of.now = text;
        of.old = old;
        row.classList.toggle('plot-old', old !== '');
      }
      if (note) of.note = note(trace);
      for (const cell of row.querySelectorAll<HTMLElement>('[data-is]')) put(cell, of[cell.dataset.is!] ?? '');
    }
    if (picker.current) picker.current.disabled = a === null;
    legend.current?.classList.toggle('plot-two', b !== null);
    for (const [is, x] of [['a', a], ['b', b]] as const) {
      const head = legend.current?.querySelector<HTMLElement>(`[data-head=${is}]`);
      if (!head) continue;
      put(head, `${is.toUpperCase()}${window.isOutside(x) ? ' outside' : ''}`);
      head.classList.toggle('plot-outside', window.isOutside(x));
    }
    if (finder.current) finder.current.hidden = !window.isOutside(a) && !window.isOutside(b);
    if (reading.current) put(reading.current, cursorText(hover.current));
  };

  const cursorText = (over: number | null) => {
    const { full } = latest.current.clock;
    const { a, b } = window;
    const parts = [];
    const at = (name: string, x: number) => `${name} ${full(x)}${window.isOutside(x) ? ' (outside)' : ''}`;
    if (a !== null) parts.push(at('A', a));
    else if (over !== null) parts.push(`Pointer ${full(over)}`);
    if (b !== null) parts.push(at('B', b));
    const both = between(a, b);
    if (both) parts.push(`B − A ${duration(both.dt)}`, `1/(B − A) ${withUnit(both.frequency, 'Hz')}`);
    return parts.map((part) => part.replaceAll(' ', '\u00a0')).join('  ');
  };

  const waiting = useRef<ReturnType<typeof setTimeout> | undefined>(undefined);
  useEffect(() => () => clearTimeout(waiting.current), []);
  const announce = () => {
    clearTimeout(waiting.current);
    waiting.current = setTimeout(() => {
      const cursor = window.b !== null && window.a === null ? window.b : window.a;
      if (cursor === null || !announcer.current) return;
      const near = (EDGE * window.span) / Math.max(host.current?.clientWidth ?? 1, 1);
      const curves = latest.current.traces.filter(({ shown }) => shown);
      const values = curves.slice(0, MOST_ANNOUNCED).map(({ name, unit, samples, stepped }) => {
        const at = valueAt(samples, cursor, near, stepped);
        return `${name} ${isFinite(at) ? withUnit(at, unit) : 'no value'}`;
      });
      const more = curves.length > MOST_ANNOUNCED ? `, and ${curves.length - MOST_ANNOUNCED} more in the table` : '';
      put(announcer.current, `${cursorText(null)}: ${values.join(', ')}${more}`);
    }, ANNOUNCE);
  };

  const moveCursors = (a: number | null, b: number | null) => {
    window.a = a;
    window.b = b;
    scheduler.request();
    announce();
  };

  const onKeyDown = (event: KeyboardEvent) => {
    if (!press(event, window, actions)) return;
    event.preventDefault();
    scheduler.request();
    announce();
  };

  const cells = live ? LIVE_CELLS : CELLS;
  const toggle = (trace: Trace) => {
    trace.shown = !trace.shown;
    redraw((count) => count + 1);
    scheduler.request();
  };

  return (
    <figure class="plot" aria-labelledby={`${id}-label`} aria-details={`${id}-table`}>
      <figcaption id={`${id}-label`}>{label}</figcaption>
      <div class="plot-body">
        <div class="plot-left">
          <div
            ref={host}
            class="plot-canvas"
            tabIndex={0}
            role="application"
            aria-roledescription="plot"
            aria-label={label}
            aria-describedby={`${id}-help`}
            onKeyDown={onKeyDown}
          />
          <p id={`${id}-help`} class="plot-hidden">{HELP}{pickLabel ? ` Enter: ${pickLabel.toLowerCase()} at cursor A.` : ''}</p>
          <p ref={announcer} class="plot-hidden" aria-live="polite" />
          <div class="plot-readings">
            <p ref={reading} class="plot-reading" />
            {pickLabel && (
              <button ref={picker} type="button" onClick={() => window.a !== null && actions.pick(window.a)}>
                {pickLabel} at A
              </button>
            )}
            <button type="button" onClick={() => moveCursors(window.b, window.a)}>Swap A and B</button>
            <button ref={finder} type="button" hidden onClick={() => (window.showCursors(), scheduler.request())}>
              Show cursors
            </button>
            <button type="button" onClick={() => moveCursors(null, null)}>Remove cursors</button>
            {children}
          </div>
          {hidden.length > 0 && (
            <p class="plot-note">No room for the axes of: {hidden.map((unit) => unit || 'no unit').join(', ')}.</p>
          )}
        </div>
        <div class="plot-legend-frame" tabIndex={0} role="region" aria-label={`Curves of ${label}`}>
          <table ref={legend} class="plot-legend" role="table">
            <thead role="rowgroup">
              <tr role="row">
                <th scope="col" role="columnheader">Curve</th>
                {cells.map(([is, name]) => <th key={is} scope="col" role="columnheader" data-head={is}>{name}</th>)}
              </tr>
            </thead>
            <tbody role="rowgroup">
              {traces.map((trace) => (
                <tr key={trace.key} data-key={trace.key} role="row">
                  <th scope="row" role="rowheader">
                    <button type="button" aria-pressed={trace.shown} onClick={() => toggle(trace)}>
                      <Swatch trace={trace} />
                      <span class="plot-name">
                        {trace.name}
                        <small> {trace.unit}{props.note && <span data-is="note" class="plot-side" />}</small>
                      </span>
                    </button>
                  </th>
                  {cells.map(([is, name]) => (
                    <td key={is} class={`plot-${is}`} role="cell" data-name={name}>
                      <span data-is={is} />
                      {is === 'now' && <small data-is="old" />}
                    </td>
                  ))}
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      </div>
      <Table id={`${id}-table`} label={label} traces={traces} window={window} clock={props.clock} />
    </figure>
  );
}

const NO_MARKS: readonly Line[] = [];
const CELLS = [['least', 'Min'], ['most', 'Max'], ['a', 'A'], ['b', 'B'], ['change', 'B − A']] as const;
const LIVE_CELLS = [['now', 'Now'], ...CELLS] as const;

function put(element: HTMLElement, text: string) {
  if (element.textContent !== text) element.textContent = text;
}

/** A piece of the curve: its colour and its dashes. */
function Swatch({ trace: { style, shown } }: { trace: Trace }) {
  const [period, drawn] = style.dash;
  return (
    <svg class="plot-swatch" width="28" height="12" aria-hidden="true" data-shown={shown}>
      {[['plot-light', style.light], ['plot-dark', style.dark]].map(([name, colour]) => (
        <line
          class={name} x1="0" y1="6" x2="28" y2="6" stroke={colour} stroke-width="2.5"
          stroke-dasharray={period ? `${drawn} ${period - drawn}` : undefined}
        />
      ))}
    </svg>
  );
}
