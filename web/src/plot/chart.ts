// A canvas with curves. uPlot draws axes and selections; the curves are drawn here.
//
// One uPlot for signals of any motors: they have different time stamps, and uPlot wants one array of
// times for all curves. So it gets no data at all. Each curve is reduced to columns on one grid of time
// (columns.ts) or drawn sample by sample, at its own times. Nothing is joined, copied or aligned, a
// frame costs as much as there are columns, and one plot can compare motors of different lines.
import uPlot from 'uplot';
import { Columns, drawColumns, drawSamples, type Frame } from './columns';
import { type Clock, onAxis } from './format';
import { labelsOf } from './labels';
import type { Extremes, Samples } from './samples';
import type { Style } from './style';

/** A curve. */
export interface Trace {
  key: string;
  name: string;
  unit: string;
  /** The line, whose clock its times have; empty for finished data. */
  line: string;
  samples: Samples;
  style: Style;
  stepped: boolean;
  shown: boolean;
  /** Its newest value is too old to be taken for the present one. */
  old: boolean;
}

/** A dashed line with a text. */
export interface Line {
  label: string;
  t?: number;
  value?: number;
  unit?: string;
}

export interface Events {
  /** A part was selected. */
  onSelect: (min: number, max: number) => void;
  /** A place was clicked: a sample of a curve, or one without a curve. */
  onPlace: (x: number, second: boolean, trace: Trace | null) => void;
  onZoom: (factor: number, x: number) => void;
  /** By a share of the span. */
  onPan: (share: number) => void;
  onHome: () => void;
  onHover: (x: number | null) => void;
}

export interface Options {
  clock: Clock;
  height: number;
  marks: readonly Line[];
  /** Curves are drawn often, and many at once. */
  live: boolean;
  events: Events;
}

/** Steps between ticks, in seconds. */
const STEPS = [
  ...[1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1].flatMap((unit) => [unit, 2 * unit, 5 * unit]),
  1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200,
];
const NEAR = 7;
const FONT = '12px system-ui, sans-serif';
const MOST_COLUMNS = 2000;

interface Axis {
  unit: string;
  scale: string;
  range: [number, number];
}

export class Chart {
  private plot: uPlot;
  private readonly columns = new Map<Trace, Columns>();
  private readonly axes: Axis[];
  private readonly found: Extremes = { min: 0, max: 0 };
  private colours = { dark: false, fg: '', muted: '', line: '' };
  private readonly theme = matchMedia('(prefers-color-scheme: dark)');
  private readonly sizes: ResizeObserver;
  private readonly marks: Record<'a' | 'b', HTMLElement>;
  private window = { min: 0, max: 1 };
  private readonly ended = new AbortController();
  private listening = new AbortController();
  /** Units whose axis has no room. */
  hidden: string[] = [];
  /** Is asked to draw again: the size or the colours changed. */
  onStale = () => {};

  constructor(
    private readonly host: HTMLElement,
    readonly traces: readonly Trace[],
    private readonly options: Options,
  ) {
    const units = [...new Set(traces.map(({ unit }) => unit))];
    this.axes = units.map((unit) => ({ unit, scale: `y${unit}`, range: [0, 1] }));
    this.readColours();
    this.plot = this.create();
    this.marks = { a: this.mark('A'), b: this.mark('B') };
    this.listen();
    this.theme.addEventListener('change', this.restyle, { signal: this.ended.signal });
    this.sizes = new ResizeObserver(() => this.fit());
    this.sizes.observe(host);
  }

  destroy() {
    this.ended.abort();
    this.listening.abort();
    this.sizes.disconnect();
    this.plot.destroy();
  }

  private readColours() {
    const style = getComputedStyle(this.host);
    const of = (name: string, or: string) => style.getPropertyValue(name).trim() || or;
    this.colours = {
      dark: this.theme.matches,
      fg: of('--fg', this.theme.matches ? '#e7ebef' : '#14181d'),
      muted: of('--muted', this.theme.matches ? '#9fa9b4' : '#555f6b'),
      line: of('--line', this.theme.matches ? '#2e363f' : '#d3d9e0'),
    };
  }

  private readonly restyle = () => {
    this.readColours();
    this.onStale();
  };

  private fit() {
    const width = this.host.clientWidth;
    if (width === 0 || width === this.plot.width) return;
    const visible = Math.min(roomFor(width), this.axes.length);
    if (visible !== this.axes.length - this.hidden.length) this.recreate();
    else this.plot.setSize({ width, height: this.options.height });
    this.onStale();
  }

  private recreate() {
    this.plot.destroy();
    this.plot = this.create();
    this.plot.over.append(this.marks.a, this.marks.b);
    this.listen();
  }

  private create(): uPlot {
    const width = Math.max(this.host.clientWidth, 200);
    const visible = this.axes.slice(0, roomFor(width));
    this.hidden = this.axes.slice(visible.length).map(({ unit }) => unit);
    const { events, clock } = this.options;
    const muted = () => this.colours.muted;
    const grid = { stroke: () => this.colours.line, width: 1 };
    const ticks = { ...grid, size: 4 };
    const options: uPlot.Options = {
      width,
      height: this.options.height,
      legend: { show: false },
      cursor: {
        points: { show: false },
        y: false,
        // Clicks after a drag are left out by `listen`.
        drag: { x: true, y: false, setScale: false, dist: 4, click: () => {} },
        bind: { dblclick: () => () => null, mousedown: (_, __, handler) => (event) => (event.shiftKey ? null : handler(event)) },
      },
      scales: {
        x: { time: false, auto: false },
        ...Object.fromEntries(this.axes.map(({ scale }) => [scale, { auto: false }])),
      },
      axes: [
        {
          stroke: muted, grid, ticks, font: FONT, size: 34, space: 80, incrs: STEPS,
          values: (_, splits, __, ___, step) => splits.map((x) => clock.tick(x, step)),
        },
        ...visible.map(({ unit, scale }, index): uPlot.Axis => ({
          scale, font: FONT, stroke: muted, ticks, label: unit || 'without unit', labelFont: FONT, labelSize: 20,
          side: index % 2 === 0 ? 3 : 1,
          grid: index === 0 ? grid : { show: false },
          size: axisSize(),
          values: (_, splits, __, ___, step) => splits.map((split) => onAxis(split, step)),
        })),
      ],
      series: [
        {},
        ...this.traces.map((trace): uPlot.Series => ({
          label: trace.name,
          scale: `y${trace.unit}`,
          show: trace.shown,
          // Lines of one device pixel are painted ten times as fast as wider ones.
          width: 1 / uPlot.pxRatio,
          stroke: () => (trace.old ? this.colours.muted : this.colours.dark ? trace.style.dark : trace.style.light),
          points: { show: false },
          paths: () => ({ stroke: this.options.live && uPlot.pxRatio === 1 ? this.path(trace) : thickened(this.path(trace)) }),
        })),
      ],
      hooks: {
        setSelect: [(plot) => {
          const { left, width: size } = plot.select;
          if (size < 4) return;
          events.onSelect(plot.posToVal(left, 'x'), plot.posToVal(left + size, 'x'));
          plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        }],
        draw: [(plot) => this.drawMarks(plot)],
      },
    };
    const none = new Float64Array(2);
    return new uPlot(options, [new Float64Array([0, 1]), ...this.traces.map(() => none)], this.host);
  }

  /** Draws this part of time. */
  draw(min: number, max: number) {
    this.window = { min, max };
    const { plot } = this;
    plot.batch(() => {
      // Showing a curve resets its scale, so this comes first.
      this.traces.forEach(({ shown }, index) => {
        if (plot.series[index + 1]!.show !== shown) plot.setSeries(index + 1, { show: shown });
      });
      plot.setScale('x', { min, max });
      for (const axis of this.axes) {
        const [low, high] = this.range(axis, min, max);
        axis.range = [low, high];
        plot.setScale(axis.scale, { min: low, max: high });
      }
    });
  }

  private range(axis: Axis, min: number, max: number): [number, number] {
    let low = Infinity;
    let high = -Infinity;
    for (const { shown, unit, samples } of this.traces) {
      if (!shown || unit !== axis.unit) continue;
      samples.extremes(samples.at(min), samples.at(max), this.found);
      low = Math.min(low, this.found.min);
      high = Math.max(high, this.found.max);
    }
    for (const { value, unit = '' } of this.options.marks) {
      if (value === undefined || unit !== axis.unit || low > high) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    if (low > high) return axis.range;
    if (low === high) return [low - (Math.abs(low) * 0.1 || 1), high + (Math.abs(high) * 0.1 || 1)];
    return uPlot.rangeNum(low, high, 0.08, true) as [number, number];
  }

  private path(trace: Trace): Path2D {
    const path = new Path2D();
    const { bbox } = this.plot;
    const { min, max } = this.window;
    const { min: low, max: high } = this.plot.scales[`y${trace.unit}`]!;
    if (low == null || high == null || !(max > min)) return path;
    const ratio = uPlot.pxRatio;
    const perSecond = bbox.width / (max - min);
    const perUnit = bbox.height / (high - low);
    const bottom = bbox.top + bbox.height;
    const count = Math.min(Math.round(bbox.width), MOST_COLUMNS);
    const width = (max - min) / count;
    const { samples } = trace;
    const from = samples.at(min);
    const to = samples.at(max, from);
    const scale = (ratio * count) / bbox.width;
    const frame: Frame = {
      x: (time) => bbox.left + (time - min) * perSecond,
      y: (value) => bottom - (value - low) * perUnit,
      dash: trace.style.dash.map((length) => Math.round(length * scale)),
      stepped: trace.stepped,
    };
    if (to - from <= count) {
      drawSamples(path, samples, Math.max(from - 1, samples.first), Math.min(to + 1, samples.end), frame, width);
      return path;
    }
    let columns = this.columns.get(trace);
    if (!columns) this.columns.set(trace, (columns = new Columns()));
    const first = Math.floor(min / width) - 1;
    const last = Math.ceil(max / width) + 1;
    columns.update(samples, gridded(width, columns.width), first, last);
    drawColumns(path, columns, first, last, frame);
    return path;
  }

  private drawMarks(plot: uPlot) {
    if (this.options.marks.length === 0) return;
    const { ctx, bbox } = plot;
    const ratio = uPlot.pxRatio;
    ctx.save();
    ctx.strokeStyle = this.colours.muted;
    ctx.fillStyle = this.colours.fg;
    ctx.font = `${12 * ratio}px system-ui, sans-serif`;
    ctx.lineWidth = ratio;
    ctx.setLineDash([4 * ratio, 4 * ratio]);
    const placed: { x: number; label: string }[] = [];
    for (const { label, t, value, unit = '' } of this.options.marks) {
      ctx.beginPath();
      if (t !== undefined) {
        const x = plot.valToPos(t, 'x', true);
        if (x < bbox.left || x > bbox.left + bbox.width) continue;
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
        placed.push({ x, label });
      } else if (value !== undefined && plot.scales[`y${unit}`]) {
        const y = plot.valToPos(value, `y${unit}`, true);
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
        ctx.textAlign = 'right';
        const crowded = this.options.marks.some((other) => {
          if (other.value === undefined || other.value <= value || (other.unit ?? '') !== unit) return false;
          return y - plot.valToPos(other.value, `y${unit}`, true) < 30 * ratio;
        });
        ctx.fillText(label, bbox.left + bbox.width - 4 * ratio, y + (crowded ? 14 : -4) * ratio);
      }
      ctx.stroke();
    }
    const width = (text: string) => ctx.measureText(text).width;
    for (const { x, text, isLeft } of labelsOf(placed, width, bbox.left + bbox.width, 4 * ratio)) {
      ctx.textAlign = isLeft ? 'right' : 'left';
      ctx.fillText(text, x + (isLeft ? -4 : 4) * ratio, bbox.top + 12 * ratio);
    }
    ctx.restore();
  }

  private mark(letter: string): HTMLElement {
    const mark = document.createElement('div');
    mark.className = `plot-cursor plot-cursor-${letter.toLowerCase()}`;
    mark.textContent = letter;
    mark.hidden = true;
    this.plot.over.append(mark);
    return mark;
  }

  /** Puts the cursors to these times. */
  place(a: number | null, b: number | null) {
    for (const [mark, x] of [[this.marks.a, a], [this.marks.b, b]] as const) {
      const { min, max } = this.window;
      mark.hidden = x === null || x < min || x > max;
      if (x !== null && !mark.hidden) {
        mark.style.transform = `translateX(${(((x - min) / (max - min)) * this.plot.over.clientWidth).toFixed(1)}px)`;
      }
    }
  }

  private listen() {
    const { over } = this.plot;
    const { events } = this.options;
    this.listening.abort();
    this.listening = new AbortController();
    const options = { signal: this.listening.signal };
    const xAt = (left: number) => this.plot.posToVal(left, 'x');
    let panning: number | null = null;
    let moved = false;

    over.addEventListener('mousemove', ({ offsetX }) => {
      if (panning === null) events.onHover(xAt(offsetX));
    }, options);
    over.addEventListener('mouseleave', () => events.onHover(null), options);
    over.addEventListener('wheel', (event) => {
      event.preventDefault();
      const sideways = event.shiftKey ? event.deltaY || event.deltaX : event.deltaX;
      if (Math.abs(sideways) > Math.abs(event.shiftKey ? 0 : event.deltaY)) events.onPan(sideways / over.clientWidth);
      else events.onZoom(Math.exp(Math.max(-300, Math.min(300, event.deltaY)) / 400), xAt(event.offsetX));
    }, { ...options, passive: false });
    over.addEventListener('dblclick', () => events.onHome(), options);

    const touches = new Map<number, number>();
    over.addEventListener('pointerdown', (event) => {
      moved = false;
      if (event.pointerType === 'mouse') {
        if (event.button === 0) panning = event.shiftKey ? event.clientX : null;
        return;
      }
      touches.set(event.pointerId, event.clientX);
    }, options);
    const move = (event: PointerEvent) => {
      if (panning !== null && event.pointerType === 'mouse') {
        const by = event.clientX - panning;
        if (by === 0) return;
        moved ||= Math.abs(by) > 3;
        panning = event.clientX;
        events.onPan(-by / over.clientWidth);
        return;
      }
      const before = touches.get(event.pointerId);
      if (before === undefined) return;
      const by = event.clientX - before;
      moved ||= Math.abs(by) > 3;
      if (touches.size === 1) {
        events.onPan(-by / over.clientWidth);
      } else if (touches.size === 2) {
        const other = [...touches].find(([id]) => id !== event.pointerId)![1];
        const was = Math.max(Math.abs(before - other), 20);
        const is = Math.max(Math.abs(event.clientX - other), 20);
        const middle = (event.clientX + other) / 2 - over.getBoundingClientRect().left;
        events.onZoom(was / is, xAt(middle));
      }
      touches.set(event.pointerId, event.clientX);
    };
    const up = (event: PointerEvent) => {
      panning = null;
      touches.delete(event.pointerId);
    };
    addEventListener('pointermove', move, options);
    addEventListener('pointerup', up, options);
    addEventListener('pointercancel', up, options);

    let pressed = 0;
    over.addEventListener('mousedown', (event) => {
      pressed = event.clientX;
      // The browser would select text up to here.
      if (event.shiftKey) event.preventDefault();
    }, options);
    over.addEventListener('click', (event) => {
      if (moved || Math.abs(event.clientX - pressed) > 3) return;
      const touch = (event as PointerEvent).pointerType === 'touch';
      const hit = touch ? null : this.curveAt(event.offsetX, event.offsetY);
      events.onPlace(hit?.x ?? xAt(event.offsetX), event.shiftKey, hit?.trace ?? null);
    }, options);
  }

  /** The curve at a place of the canvas, and its sample there. A spike between two pixels is found, too. */
  private curveAt(left: number, top: number): { trace: Trace; x: number } | null {
    let best: { trace: Trace; x: number } | null = null;
    let nearest = NEAR;
    const from = this.plot.posToVal(left - 3, 'x');
    const to = this.plot.posToVal(left + 3, 'x');
    for (const trace of this.traces) {
      if (!trace.shown) continue;
      const { samples } = trace;
      const scale = `y${trace.unit}`;
      const start = Math.max(samples.at(from) - 1, samples.first);
      const end = Math.min(samples.at(to) + 1, samples.end);
      samples.extremes(start, end, this.found);
      if (this.found.min > this.found.max) continue;
      const bottom = this.plot.valToPos(this.found.min, scale);
      const upper = this.plot.valToPos(this.found.max, scale);
      const distance = Math.max(upper - top, top - bottom, 0);
      if (distance >= nearest) continue;
      nearest = distance;
      const value = this.plot.posToVal(top, scale);
      const middle = (from + to) / 2;
      let least = Infinity;
      for (let number = start; number < end; number += 1) {
        const away = Math.abs(samples.y(number) - value) + 1e-9 * Math.abs(samples.x(number) - middle);
        if (away < least) {
          least = away;
          best = { trace, x: samples.x(number) };
        }
      }
    }
    return best;
  }
}

/** Two lines beside each other are still fast. */
function thickened(path: Path2D): Path2D {
  path.addPath(new Path2D(path), { e: 1, f: 1 });
  return path;
}

/** How many axes fit beside a plot. */
function roomFor(width: number): number {
  return width < 560 ? 2 : 4;
}

/** Wide enough for its numbers. It grows only, so that the plot does not jump. */
function axisSize(): uPlot.Axis.Size {
  let widest = 44;
  return (_, values) => {
    for (const text of values ?? []) widest = Math.max(widest, 14 + 7.2 * text.length);
    return widest;
  };
}

/** The same width again as long as the difference is one of rounding: the columns stay valid. */
function gridded(width: number, before: number): number {
  return Math.abs(width - before) <= before * 1e-9 ? before : width;
}
