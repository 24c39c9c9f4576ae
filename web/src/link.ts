// The connection to the server: requests, subscriptions, signs of life.
import { signal } from '@preact/signals';
import { ServerClock } from './clock';
import { LIVE, nameOf } from './format';
import {
  type Entry, state, welcome, lastWelcome, lines, latchedBy, linesAt, motors, found, searchFailed, entries,
  events, unconfirmed, lapsed, closedWhy, shareLost, recorded, rans, holds, delay, held,
} from './link-state';
import { type Rows, decode, groupOf } from './rows';
import type {
  Beat, Event as DriveEvent, Group, Line, Request, ShareRequest, ShareText, SignalName, Text,
} from './wire';

export * from './link-state';
export type { Rows } from './rows';

type Without<T> = T extends unknown ? Omit<T, 'id'> : never;
/** A request to the server or, through it, to the share. */
export type Ask = Without<Request> | Without<ShareRequest>;
/** The answer to a request. */
export type AnswerTo<K extends Ask['ask']> = Extract<Text | ShareText, { kind: 'answer'; to: K }>;

/** A request was not carried out. */
export class Refused extends Error {
  constructor(
    readonly reason: string,
    message: string,
  ) {
    super(message);
  }
}

interface Want {
  signals: SignalName[];
  period: number;
  rows: boolean;
  onRows: (rows: Rows) => void;
  /** The share's number, on this connection. `null`: the share was asked for it. */
  subscription?: number | null;
  /** Why the share gives nothing. */
  onRefused: (why: Refused) => void;
}

const RECONNECT = 1000;
const ALIVE = 50;
/** A page that looks at the connection later than this did not run meanwhile. */
const PAUSED = 200;
const SILENT = 500;
/** A connection that gives nothing for so long is given up. The browser may not notice for minutes. */
const DEAD = 5000;
/** Clocks of lines drift, and what was refused may be possible later. */
const LATER = 10_000;
const RELEASE = 1000;
/** After an event about a stop the lines are asked for once, so much later: more events follow. */
const SOON = 50;
const MOST_EVENTS = 2000;
/** Commands that are so near to each other, in entries and seconds, are one entry. */
const NEAR = 40;
const PAUSE = 0.5;

let socket: WebSocket | null = null;
let lastId = 0;
let lastEntry = 0;
interface Pending {
  /** Whether the share answers it, not the server. */
  isOfShare: boolean;
  done: (answer: Text | ShareText) => void;
  failed: (why: Refused) => void;
}

const SHARE_ASKS: ReadonlySet<string> = new Set<ShareRequest['ask']>([
  'lines', 'signals', 'subscribe', 'unsubscribe', 'rates', 'frames', 'ports', 'scan', 'open', 'close', 'stop', 'latch', 'release',
]);

const pending = new Map<number, Pending>();
const wants = new Set<Want>();
const groups = new Map<number, { want: Want; group: Group }>();
const clocks = new Map<string, { t: number; wall: number }>();
const clock = new ServerClock();

let beat = 0;
let drawnBeat = 0;
let frame = 0;
/** The frame that the last sign of life named, and when the last sign with a new frame was sent. */
let saidFrame = 0;
let aliveAt = -Infinity;
/** For how long no beat was received, without the time in which this page did not run. */
let quiet = 0;
let measuredDelay = 0;
let lookedAt = 0;
let releasedAt = -Infinity;
let refreshTimer: ReturnType<typeof setTimeout> | null = null;

/** Sends a request. Rejects with `Refused`. */
export function ask<A extends Ask>(wanted: A): Promise<AnswerTo<A['ask']>> {
  return new Promise((done, failed) => request(wanted, done, failed));
}

/** As `ask`. The answer is given before the next message is read. */
function request<A extends Ask>(
  wanted: A,
  done: (answer: AnswerTo<A['ask']>) => void,
  failed: (why: Refused) => void,
) {
  lastId += 1;
  if (!welcome.value || !say({ id: lastId, ...wanted })) {
    failed(new Refused('line', 'There is no connection to the server.'));
    return;
  }
  const isOfShare = SHARE_ASKS.has(wanted.ask);
  pending.set(lastId, { isOfShare, done: done as (answer: Text | ShareText) => void, failed });
}

/** Receives signals each `period` seconds, on this connection and later ones. Returns what ends it. */
export function subscribe(
  signals: SignalName[],
  period: number,
  onRows: (rows: Rows) => void,
  { rows = false, onRefused = () => {} }: { rows?: boolean; onRefused?: (why: Refused) => void } = {},
): () => void {
  const want: Want = { signals, period, rows, onRows, onRefused };
  wants.add(want);
  if (welcome.value) begin(want);
  return () => {
    wants.delete(want);
    if (want.subscription != null) end(want.subscription);
  };
}

function begin(want: Want) {
  const { signals, period, rows } = want;
  want.subscription = null;
  request(
    { ask: 'subscribe', signals, period, queue: 20_000, drop: 'oldest', rows },
    ({ subscription }) => {
      if (wants.has(want)) want.subscription = subscription;
      else end(subscription);
    },
    (why) => {
      delete want.subscription;
      want.onRefused(why);
    },
  );
}

function end(subscription: number) {
  for (const [number, { group }] of groups) {
    if (group.subscription === subscription) groups.delete(number);
  }
  ask({ ask: 'unsubscribe', subscription }).catch(() => {});
}

function forgetSubscriptions() {
  groups.clear();
  for (const want of wants) delete want.subscription;
}

/** The wall clock of the server, in seconds since 1970. NaN until it is known. */
export function wallNow(): number {
  return clock.at(performance.now()) / 1000;
}

/** The wall clock at a time of a line's clock. NaN until it is known. */
export function wallAt(line: string, t: number): number {
  const known = clocks.get(line);
  return known ? known.wall + (t - known.t) : NaN;
}

/**
 * How old a value is, in seconds, by its time of the wall clock. Convert it with `wallAt` when it arrives: another
 * share at the same place begins its clocks anew. NaN if it is not known, also for a time to come: such a value is
 * not live.
 */
export function age(wall: number): number {
  const seconds = wallNow() - wall;
  return seconds > -LIVE ? seconds : NaN;
}

/** Sends a text at once, if there is a connection. */
function say(text: object): boolean {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(text));
  return true;
}

/** Gives up the motors that this page turned: they stop. */
export function letGo() {
  held.value = false;
  if (welcome.value?.role === 'operator') ask({ ask: 'let-go' }).catch(() => {});
}

/** The key or the finger of hold-to-run is up. The server stops what was held at once. */
export function release() {
  held.value = false;
  releasedAt = performance.now();
  sayAlive();
}

/** A sign of life. It is true only as long as the browser draws this page. */
export function sayAlive() {
  if (!welcome.value) return;
  const now = performance.now();
  if (say({ beat: drawnBeat, frame, held: held.value, at: now }) && frame > saidFrame) {
    saidFrame = frame;
    aliveAt = now;
  }
}

function drawn() {
  frame += 1;
  drawnBeat = beat;
  // The timer may have run before this frame: its sign then proved nothing, and the next is `ALIVE` away.
  if (performance.now() - aliveAt > ALIVE) sayAlive();
  requestAnimationFrame(drawn);
}

/** Connects, and connects again whenever the connection is lost. */
export function start(url = new URL('ws', location.href)) {
  url.protocol = location.protocol === 'https:' ? 'wss:' : 'ws:';
  connect(url);
  lookedAt = performance.now();
  requestAnimationFrame(drawn);
  setInterval(() => {
    sayAlive();
    look(url);
  }, ALIVE);
  setInterval(() => {
    void refreshLines();
    // What was refused may be possible now.
    for (const want of wants) if (want.subscription === undefined && welcome.value) begin(want);
  }, LATER);
  document.addEventListener('visibilitychange', () => {
    if (document.hidden) letGo();
  });
  addEventListener('pagehide', () => {
    held.value = false;
    const { run, name } = welcome.value ?? {};
    if (run) navigator.sendBeacon(`api/let-go?${new URLSearchParams({ run, page: name ?? '' })}`);
  });
}

function connect(url: URL) {
  quiet = 0;
  const opened = new WebSocket(url);
  opened.binaryType = 'arraybuffer';
  socket = opened;
  opened.onmessage = ({ data }) => {
    if (socket !== opened) return;
    if (typeof data === 'string') heard(JSON.parse(data) as Text | ShareText);
    else samples(data as ArrayBuffer);
  };
  opened.onclose = () => {
    if (socket === opened) lost(url);
  };
}

/** How late the connection is. */
function look(url: URL) {
  const now = performance.now();
  // A page that did not run has not looked at what was received.
  quiet += Math.min(now - lookedAt, PAUSED);
  lookedAt = now;
  if (socket && quiet > DEAD) {
    const silent = socket;
    lost(url);
    silent.close();
    return;
  }
  delay.value = Math.max(measuredDelay, quiet > SILENT ? quiet : 0);
  const isLate = delay.value > SILENT;
  if (isLate && state.value === 'open') state.value = 'silent';
  if (!isLate && state.value === 'silent') state.value = 'open';
}

function lost(url: URL) {
  socket = null;
  state.value = 'lost';
  welcome.value = null;
  holds.value = false;
  held.value = false;
  forgetSubscriptions();
  fail(() => true, 'The connection to the server was lost. It is unknown whether this was done.');
  setTimeout(() => connect(url), RECONNECT);
}

/** Nobody answers these requests any more. */
function fail(which: (request: Pending) => boolean, why: string) {
  const ended = new Refused('line', why);
  const lost = [...pending].filter(([, request]) => which(request));
  for (const [id] of lost) pending.delete(id);
  for (const [, { failed }] of lost) failed(ended);
}

function shareEnded() {
  forgetSubscriptions();
  fail(({ isOfShare }) => isOfShare, 'The share was lost. It is unknown whether this was done.');
}

function heard(text: Text | ShareText) {
  switch (text.kind) {
    case 'welcome':
      if (lastWelcome.value && lastWelcome.value.run !== text.run) {
        motors.value = new Map();
        found.value = new Map();
      }
      welcome.value = text;
      lastWelcome.value = text;
      state.value = 'open';
      shareLost.value = null;
      closedWhy.value = null;
      recorded.value = null;
      measuredDelay = 0;
      clock.forget();
      begunAgain();
      break;
    case 'beat':
      measure(text);
      break;
    case 'answer': {
      const waiting = pending.get(text.id);
      pending.delete(text.id);
      waiting?.done(text);
      break;
    }
    case 'refusal': {
      const waiting = pending.get(text.id);
      pending.delete(text.id);
      waiting?.failed(new Refused(text.reason, text.message));
      break;
    }
    case 'group': {
      const want = [...wants].find((one) => one.subscription === text.subscription);
      if (want) groups.set(text.group, { want, group: text });
      break;
    }
    case 'unconfirmed': {
      const count = (unconfirmed.value.get(text.line) ?? 0) + text.rows;
      unconfirmed.value = new Map(unconfirmed.value).set(text.line, count);
      break;
    }
    case 'event':
      happened(text);
      break;
    case 'missed':
      happened({
        wall: wallNow(),
        event: 'later',
        message: `${text.events} events were not received, because this page was too slow`,
      });
      break;
    case 'lapsed':
      held.value = false;
      // The end of what was held is no news to the person who let it go.
      if (performance.now() - releasedAt > RELEASE) lapsed.value = text.message;
      break;
    case 'ran':
      rans.value = new Map(rans.value).set(nameOf(text.line, text.motor), text);
      break;
    case 'closing':
      closedWhy.value = text.message;
      break;
    case 'share': {
      const wasLost = shareLost.value !== null;
      shareLost.value = text.lost;
      if (text.lost !== null) shareEnded();
      else if (wasLost) begunAgain();
      break;
    }
    case 'recorded':
      recorded.value = text;
      break;
    default:
      break;
  }
}

/** There is a new session at the share: it knows no subscription. */
function begunAgain() {
  forgetSubscriptions();
  void refreshLines();
  wants.forEach(begin);
}

/** Whether an event is the same command again, with other numbers: a ramp is many of them. */
function continues(entry: Entry, { event, line, motor, by, wall, message }: DriveEvent): boolean {
  const withoutNumbers = (text: string) => text.replace(/(?<![\w.])[-−+]?\d[\d.]*/g, '');
  return (
    event === 'commanded' && entry.event === event && entry.line === line && entry.motor === motor &&
    entry.by === by && wall - entry.until < PAUSE && withoutNumbers(entry.message) === withoutNumbers(message)
  );
}

function happened(event: DriveEvent) {
  events.value = [...events.value.slice(1 - MOST_EVENTS), event];
  const all = entries.value;
  const first = Math.max(0, all.length - NEAR);
  const at = all.findLastIndex((one, index) => index >= first && continues(one, event));
  const earlier = all[at];
  if (earlier) {
    const joined = { ...earlier, message: event.message, times: earlier.times + 1, until: event.wall };
    entries.value = all.with(at, joined);
  } else {
    lastEntry += 1;
    const entry = { ...event, number: lastEntry, times: 1, until: event.wall };
    entries.value = [...all.slice(1 - MOST_EVENTS), entry];
  }
  if (event.event === 'latched') latchedBy.value = event.by ?? 'another program';
  if (event.event === 'released') latchedBy.value = null;
  if (['back', 'opened', 'closed'].includes(event.event)) void refreshLines();
  if (['latched', 'stopped', 'stop-failed'].includes(event.event)) refreshSoon();
}

function refreshSoon() {
  refreshTimer ??= setTimeout(() => {
    refreshTimer = null;
    void refreshLines();
  }, SOON);
}

function measure({ beat: number, wall, at, since, holds: has }: Beat) {
  beat = number;
  quiet = 0;
  holds.value = has;
  measuredDelay = clock.heard(performance.now(), wall * 1000, at, since) ?? measuredDelay;
}

/** Asks for the lines: their clocks and counts are those of the answer. */
export async function refreshLines() {
  try {
    const answer = await ask({ ask: 'lines' });
    for (const { line, t, wall } of answer.lines) clocks.set(line, { t, wall });
    linesAt.value = lastEntry;
    lines.value = answer.lines;
    forgetMotors(answer.lines);
    answer.lines.forEach(keepMotors);
    latchedBy.value = answer.latched_by ?? null;
    for (const { line } of answer.lines) {
      if (!found.value.get(line)?.length) void refreshMotors(line);
    }
  } catch {
    // The next connection asks again.
  }
}

/** Lines that were closed have no motors any more. */
function forgetMotors(known: readonly Line[]) {
  const isThere = ([line]: [string, unknown]) => known.some((one) => one.line === line);
  const left = [...motors.value].filter(isThere);
  if (left.length < motors.value.size) motors.value = new Map(left);
  const ofSearch = [...found.value].filter(isThere);
  if (ofSearch.length < found.value.size) found.value = new Map(ofSearch);
}

/** A motor that answered before may turn although no search finds it. */
function keepMotors({ line, heard, unstopped }: Line) {
  const searched = found.value.get(line);
  const numbers = new Set([...(searched ?? []), ...(heard ?? []), ...(unstopped ?? [])]);
  // Any motor of the line is none that a card is for.
  numbers.delete(0);
  const all = [...numbers].sort((a, b) => a - b);
  if (all.length === 0 && !searched) return;
  if (motors.value.get(line)?.join() !== all.join()) motors.value = new Map(motors.value).set(line, all);
}

/** Lines that are being searched. */
export const searching = signal<ReadonlySet<string>>(new Set());

/** Searches the motors of a line again. */
export async function refreshMotors(line: string) {
  if (searching.value.has(line)) return;
  searching.value = new Set(searching.value).add(line);
  let failure: string | null = null;
  try {
    const answer = await ask({ ask: 'motors', line });
    found.value = new Map(found.value).set(line, answer.motors);
    const known = lines.value.find((one) => one.line === line);
    if (known) keepMotors(known);
    else motors.value = new Map(motors.value).set(line, answer.motors);
  } catch (why) {
    failure = (why as Error).message;
  }
  const failed = new Map(searchFailed.value);
  if (failure === null) failed.delete(line);
  else failed.set(line, failure);
  searchFailed.value = failed;
  const rest = new Set(searching.value);
  rest.delete(line);
  searching.value = rest;
}

function samples(buffer: ArrayBuffer) {
  const number = groupOf(buffer);
  const known = number === null ? undefined : groups.get(number);
  const rows = known && decode(buffer, known.group);
  if (rows) known.want.onRows(rows);
}
