// The plots' state, which outlives the view: signals are read on while another view is open, so that a
// look at the wire does not tear a hole into the curves.
import { effect, signal, untracked } from '@preact/signals';
import { allMotors, descriptions, watchDescriptions } from '../drives';
import * as link from '../link';
import type { Column, Event as DriveEvent } from '../wire';
import { Scheduler } from './scheduler';
import { type Chosen, load, remembers, save, type Settings, usual } from './settings';
import { keyOf, LONGEST, Store, type Wanted } from './store';
import { numbered, styleOf } from './style';
import { Window } from './window';

const LEAST_SPAN = 1e-3;
const HOUR = 3600;

export const store = new Store(link, Math.floor(Date.now() / 1000 / HOUR) * HOUR);
export const settings = signal<Settings>(load(localStorage));
/** What can be read of the motors of each line. */
export const catalogue = signal<ReadonlyMap<string, readonly Column[]>>(new Map());
/** Signals that are chosen, and that no line has now. */
export const missing = signal<readonly Chosen[]>([]);
/** Changes with the curves of the store. */
export const curves = signal(store.curves);
export const time = new Window(settings.value.span, true, LEAST_SPAN, LONGEST);
const lessMotion = matchMedia('(prefers-reduced-motion: reduce)');
export const scheduler = new Scheduler(time, () => store.now(), () => lessMotion.matches);

let started = false;
/** What nobody chose: it is not remembered. */
let proposed = settings.value;
let numbers: ReadonlyMap<string, number> = new Map();
let lastEvent: DriveEvent | undefined;

/** Begins to read the chosen signals. */
export function start() {
  if (started) return;
  started = true;
  store.onSamples = scheduler.sampled;
  lastEvent = link.events.value.at(-1);
  effect(() => {
    if (settings.value !== proposed) save(localStorage, settings.value);
  });
  if (!remembers(localStorage)) propose();
  effect(() => {
    for (const { line } of link.lines.value) void describe(line);
  });
  effect(read);
  effect(() => {
    const all = link.events.value;
    // The oldest are dropped: without the last one that was seen, all are new.
    for (const event of all.slice(all.lastIndexOf(lastEvent!) + 1)) heard(event);
    lastEvent = all.at(-1);
  });
  effect(() => {
    if (link.state.value === 'lost') store.interrupt();
    scheduler.request();
  });
}

/** Shows the usual signals of the motors that are found, until somebody chooses others. */
function propose() {
  const forget = watchDescriptions();
  effect(() => {
    const signals = usual(allMotors.value, (line) => descriptions.value.get(line)?.overview.speed);
    const known = settings.peek();
    if (known !== proposed) forget();
    else if (signals.length !== known.signals.length) settings.value = proposed = { ...known, signals };
  });
}

async function describe(line: string) {
  if (untracked(() => catalogue.value.has(line))) return;
  try {
    const { signals } = await link.ask({ ask: 'signals', line });
    catalogue.value = new Map(catalogue.value).set(line, signals);
  } catch {
    // The list of lines is read again, and this with it.
  }
}

/** Reads what is chosen and possible. */
function read() {
  const wanted: Wanted[] = [];
  const absent: Chosen[] = [];
  for (const chosen of settings.value.signals) {
    const column = catalogue.value.get(chosen.line)?.find(({ name }) => name === chosen.name);
    if (column) wanted.push({ ...chosen, unit: column.unit });
    else absent.push(chosen);
  }
  numbers = numbered(wanted.map(keyOf), numbers);
  store.set(wanted, (key) => styleOf(numbers.get(key) ?? 0));
  curves.value = store.curves;
  missing.value = absent;
  scheduler.request();
}

function heard({ event, line, motor, since, t }: DriveEvent) {
  if (event === 'doubtful' && line != null && motor != null && since != null) {
    store.doubt(line, motor, since, t ?? store.lineTime(line, store.now()));
  } else if (event === 'later' && line == null) {
    store.doubtAll();
  } else if (event === 'lost' || event === 'silent') {
    store.interrupt(line ?? undefined, motor ?? undefined);
  }
}
