// A step response that was recorded, and the list of those that are kept.
import { signal } from '@preact/signals';
import type { MotorName, Mode } from '../wire';
import { type Analysis, DEFINITIONS, type Figure, type FigureName, WAY, analyse } from './analysis';

/** A gain, or another register that shapes the response. */
export interface Gain {
  name: string;
  text: string;
  unit: string;
}

export interface Run {
  /** A number of this browser, from 1. */
  number: number;
  /** Wall clock of the step, in ms since 1970. */
  when: number;
  motor: MotorName;
  mode: Mode;
  unit: string;
  measured: string;
  from: number;
  to: number;
  /** Seconds after the step (its earliest possible time is `-doubt`, its latest `doubt`). */
  t: number[];
  y: (number | null)[];
  /** The reference as the drive reports it; null if it reports none. */
  reference: (number | null)[] | null;
  doubt: number;
  resolution: number;
  gains: Gain[];
  /** The time between two values that the line carried, in seconds, if the share said it. */
  carried: number | null;
  /** Rows that were lost because this page was too slow. */
  lost: number;
  /** What the drive does with the step itself, in words. */
  ramp: string;
  /** Whether points were left out to keep it. The analysis is of all points. */
  isThinned: boolean;
  analysis: Analysis;
}

const KEY = 'motorlink.steps.1';
const MOST_RUNS = 12;
/** Points of a run that the browser keeps, and that the page keeps. */
const MOST_KEPT = 3000;
const MOST_POINTS = 100_000;

/** The newest first. */
export const runs = signal<readonly Run[]>(load());

export function add(run: Omit<Run, 'number' | 'analysis' | 'isThinned'>): Run {
  const number = 1 + Math.max(0, ...runs.value.map((one) => one.number));
  const analysis = analyse({
    t: run.t,
    y: run.y.map((value) => value ?? NaN),
    at: [-run.doubt, run.doubt],
    from: run.from,
    to: run.to,
    resolution: run.resolution,
  });
  const added = thinned({ ...run, number, analysis, isThinned: false }, MOST_POINTS);
  runs.value = [added, ...runs.value].slice(0, MOST_RUNS);
  save();
  return added;
}

export function remove(number: number) {
  runs.value = runs.value.filter((run) => run.number !== number);
  save();
}

/** Keeps as many runs as the browser takes, the newest first. */
function save() {
  for (let count = runs.value.length; count >= 0; count -= 1) {
    try {
      localStorage.setItem(KEY, JSON.stringify(runs.value.slice(0, count).map((run) => thinned(run, MOST_KEPT))));
      return;
    } catch {
      // It is full, or not permitted: the runs stay as long as the page.
    }
  }
}

function thinned(run: Run, most: number): Run {
  if (run.t.length <= most) return run;
  const every = Math.ceil(run.t.length / most);
  const some = <T>(all: T[]) => all.filter((_, index) => index % every === 0);
  return {
    ...run,
    t: some(run.t), y: some(run.y), reference: run.reference && some(run.reference), isThinned: true,
  };
}

function load(): Run[] {
  try {
    const kept: unknown = JSON.parse(localStorage.getItem(KEY) ?? '[]');
    return Array.isArray(kept) ? kept.filter(isRun).map(revived) : [];
  } catch {
    return [];
  }
}

function isRun(kept: unknown): kept is Run {
  const run = kept as Partial<Run> | null;
  return (
    typeof run?.number === 'number' && Array.isArray(run.t) && Array.isArray(run.y) && run.t.length === run.y.length &&
    Array.isArray(run.gains) && typeof run.motor?.line === 'string' && !!run.analysis?.figures &&
    (Object.keys(DEFINITIONS) as FigureName[]).every((name) => run.analysis!.figures[name])
  );
}

/** JSON has no NaN. */
function revived(run: Run): Run {
  const analysis = { ...run.analysis };
  for (const name of ['initial', 'final', 'noise', 'interval', 'longest', 'update'] as const) {
    analysis[name] ??= NaN;
  }
  return { ...run, analysis };
}

export function title({ number, motor, mode, from, to, unit }: Run): string {
  return `${number}: ${motor.line}/${motor.motor}, ${mode} ${from} to ${to} ${unit}`;
}

/** The name of a file with a run. */
export function fileName(run: Run, extension: string): string {
  return `step-${run.number}-${run.motor.line}-${run.motor.motor}-${run.mode}.${extension}`;
}

export function json(run: Run): string {
  return `${JSON.stringify({ ...run, when: new Date(run.when).toISOString(), definitions: DEFINITIONS, way: WAY }, null, 1)}\n`;
}

/** Samples as CSV, after comments with what the file is about. */
export function csv(run: Run): string {
  const header = [
    `# step response of motor ${run.motor.motor} of ${run.motor.line}, ${run.mode} from ${run.from} to ${run.to} ${run.unit}`,
    `# ${new Date(run.when).toISOString()}; t is the time after the step, known to +-${run.doubt} s`,
    ...run.gains.map(({ name, text, unit }) => `# ${name} = ${text}${unit && ` ${unit}`}`),
    ...(Object.keys(DEFINITIONS) as FigureName[]).map(
      (name) => `# ${name}: ${figureText(run.analysis.figures[name], unitOf(name, run))}`,
    ),
    ...(run.isThinned ? ['# points were left out; the numbers above are of all points'] : []),
  ];
  const names = ['t_s', run.measured, ...(run.reference ? ['reference'] : [])];
  const rows = run.t.map((t, index) =>
    [t.toFixed(6), run.y[index] ?? '', ...(run.reference ? [run.reference[index] ?? ''] : [])].join(','),
  );
  return `${[...header, names.join(','), ...rows].join('\n')}\n`;
}

export function unitOf(name: FigureName, { unit }: Pick<Run, 'unit'>): string {
  return DEFINITIONS[name].unit || unit;
}

/** A number with its uncertainty, in a unit that fits. */
export function figureText(figure: Figure, unit: string): string {
  const [scale, shown] = unit === 's' ? [1000, 'ms'] : [1, unit];
  switch (figure.kind) {
    case 'value': {
      const error = scale * figure.error;
      const decimals = decimalsFor(error);
      const value = (scale * figure.value).toFixed(decimals);
      return `${Number(value) === 0 ? value.replace('-', '') : value} ± ${error.toFixed(decimals)} ${shown}`;
    }
    case 'below':
      return `below ${Number((scale * figure.bound).toPrecision(2))} ${shown}`;
    case 'none':
      return 'no number';
  }
}

/** As many decimals as the error has two digits. */
function decimalsFor(error: number): number {
  if (!(error > 0)) return 2;
  return Math.min(4, Math.max(0, 1 - Math.floor(Math.log10(error))));
}
