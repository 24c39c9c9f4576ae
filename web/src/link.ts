// The connection to the server: requests, subscriptions, signs of life, and what the server said last.
import { signal } from '@preact/signals';
import type {
  Beat, Column, Event as DriveEvent, Group, Line, Request, ShareRequest, ShareText, SignalName, Text, Welcome,
} from './wire';

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

/** Values of signals of a motor that were read together. Views of one buffer: copy what is kept. */
export interface Rows {
  line: string;
  motor: number;
  columns: Column[];
  /** The line's clock at `t[0] == 0`, in seconds. */
  t0: number;
  t: Float64Array;
  /** From request to reply, in seconds. */
  span: Float64Array;
  /** A column for each of `columns`. NaN is no value. */
  values: Float64Array[];
  /** Records that were lost just before, because this page was too slow. */
  lost: number;
}

interface Want {
  signals: SignalName[];
  period: number;
  rows: boolean;
  onRows: (rows: Rows) => void;
  /** The share's number, on this connection. */
  subscription?: number;
  /** Why the share gives nothing. */
  onRefused: (why: Refused) => void;
}

/** `silent`: the socket seems open, and nothing comes through it. */
export const state = signal<'connecting' | 'open' | 'silent' | 'lost'>('connecting');
export const welcome = signal<Welcome | null>(null);
export const lines = signal<Line[]>([]);
/** Who latched the share: motion is refused. */
export const latchedBy = signal<string | null>(null);
/** The motors that were found, by line. */
export const motors = signal<ReadonlyMap<string, readonly number[]>>(new Map());
/** The newest last. */
export const events = signal<readonly DriveEvent[]>([]);
/** Why the page's motors were stopped last. */
export const lapsed = signal<string | null>(null);
/** Why the share is lost. */
export const shareLost = signal<string | null>(null);
/** Whether this page turned motors, so that its end stops them. */
export const holds = signal(false);
/** Time to the server and back, in ms. */
export const delay = signal(0);
/** Whether the key or the finger of hold-to-run is down. */
export const held = signal(false);

const RECONNECT = 1000;
const ALIVE = 100;
const SILENT = 500;
const MOST_EVENTS = 2000;
const HEADER = 32;
const VERSION = 1;

let socket: WebSocket | null = null;
let lastId = 0;
const pending = new Map<number, { done: (answer: Text | ShareText) => void; failed: (why: Refused) => void }>();
const wants = new Set<Want>();
const groups = new Map<number, { want: Want; group: Group }>();
const clocks = new Map<string, { t: number; wall: number }>();

let heardAt = 0;
let beat = 0;
let drawnBeat = 0;
let frame = 0;
let best = Infinity;
let offset = 0;

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
  pending.set(lastId, { done: done as (answer: Text | ShareText) => void, failed });
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
    if (want.subscription !== undefined) end(want.subscription);
  };
}

function begin(want: Want) {
  const { signals, period, rows } = want;
  request(
    { ask: 'subscribe', signals, period, queue: 20_000, drop: 'oldest', rows },
    ({ subscription }) => {
      if (wants.has(want)) want.subscription = subscription;
      else end(subscription);
    },
    want.onRefused,
  );
}

function end(subscription: number) {
  for (const [number, { group }] of groups) {
    if (group.subscription === subscription) groups.delete(number);
  }
  ask({ ask: 'unsubscribe', subscription }).catch(() => {});
}

/** The wall clock of the server, in seconds since 1970. */
export function wallNow(): number {
  return (performance.now() + offset) / 1000;
}

/** The wall clock at a time of a line's clock. */
export function wallAt(line: string, t: number): number {
  const clock = clocks.get(line);
  return clock ? clock.wall + (t - clock.t) : NaN;
}

/** How old a value of a line is, in seconds. */
export function age(line: string, t: number): number {
  return wallNow() - wallAt(line, t);
}

/** Sends a text at once, if there is a connection. */
function say(text: object): boolean {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(text));
  return true;
}

/** Gives up the motors that this page turned: they stop. */
export function letGo() {
  if (welcome.value) ask({ ask: 'let-go' }).catch(() => {});
}

/** A sign of life. It is true only as long as the browser draws this page. */
export function sayAlive() {
  if (welcome.value) say({ beat: drawnBeat, frame, held: held.value, at: performance.now() });
}

function drawn() {
  frame += 1;
  drawnBeat = beat;
  requestAnimationFrame(drawn);
}

/** Connects, and connects again whenever the connection is lost. */
export function start(url = new URL('ws', location.href)) {
  url.protocol = location.protocol === 'https:' ? 'wss:' : 'ws:';
  const connect = () => {
    const opened = new WebSocket(url);
    opened.binaryType = 'arraybuffer';
    socket = opened;
    opened.onmessage = ({ data }) => {
      heardAt = performance.now();
      if (typeof data === 'string') heard(JSON.parse(data) as Text | ShareText);
      else samples(data as ArrayBuffer);
    };
    opened.onclose = () => {
      lost();
      setTimeout(connect, RECONNECT);
    };
  };
  connect();
  requestAnimationFrame(drawn);
  setInterval(() => {
    sayAlive();
    const isSilent = performance.now() - heardAt > SILENT;
    if (isSilent && state.value === 'open') state.value = 'silent';
    if (!isSilent && state.value === 'silent') state.value = 'open';
  }, ALIVE);
  setInterval(refreshLines, 10_000);
  document.addEventListener('visibilitychange', () => {
    if (document.hidden && holds.value) letGo();
  });
  addEventListener('pagehide', () => {
    const { run, name } = welcome.value ?? {};
    if (run) navigator.sendBeacon(`api/let-go?${new URLSearchParams({ run, page: name ?? '' })}`);
  });
}

function lost() {
  state.value = 'lost';
  welcome.value = null;
  holds.value = false;
  held.value = false;
  groups.clear();
  const ended = new Refused('line', 'The connection to the server was lost.');
  for (const { failed } of pending.values()) failed(ended);
  pending.clear();
  for (const want of wants) delete want.subscription;
}

function heard(text: Text | ShareText) {
  switch (text.kind) {
    case 'welcome':
      welcome.value = text;
      state.value = 'open';
      best = Infinity;
      void refreshLines();
      wants.forEach(begin);
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
    case 'event':
      events.value = [...events.value.slice(1 - MOST_EVENTS), text];
      if (text.event === 'latched') latchedBy.value = text.by ?? 'somebody';
      if (text.event === 'released') latchedBy.value = null;
      if (text.event === 'back') void refreshLines();
      break;
    case 'lapsed':
      lapsed.value = text.message;
      break;
    case 'share':
      shareLost.value = text.lost;
      if (text.lost === null) void refreshLines();
      break;
    default:
      break;
  }
}

function measure({ beat: number, wall, at, since, holds: has }: Beat) {
  beat = number;
  holds.value = has;
  const now = performance.now();
  if (at !== null) delay.value = now - at - since;
  // The least delay says most about the clocks. It is forgotten slowly: clocks drift.
  best += 0.01;
  const half = at === null ? 0 : (now - at - since) / 2;
  if (half <= best) {
    best = half;
    offset = wall * 1000 + half - now;
  }
}

async function refreshLines() {
  try {
    const answer = await ask({ ask: 'lines' });
    for (const { line, t, wall } of answer.lines) clocks.set(line, { t, wall });
    lines.value = answer.lines;
    latchedBy.value = answer.latched_by ?? null;
    for (const { line } of answer.lines) {
      if (!motors.value.get(line)?.length) void refreshMotors(line);
    }
  } catch {
    // The next connection asks again.
  }
}

/** Searches the motors of a line again. */
export async function refreshMotors(line: string) {
  const found = await ask({ ask: 'motors', line });
  motors.value = new Map(motors.value).set(line, found.motors);
}

function samples(buffer: ArrayBuffer) {
  const head = new DataView(buffer);
  const number = (at: number) => head.getUint32(at, true);
  const known = groups.get(number(4));
  if (number(0) !== VERSION || !known) return;
  const count = number(12);
  const column = (at: number) => new Float64Array(buffer, HEADER + 8 * count * at, count);
  const { want, group } = known;
  want.onRows({
    line: group.line,
    motor: group.motor,
    columns: group.columns,
    t0: head.getFloat64(24, true),
    t: column(0),
    span: column(1),
    values: group.columns.map((_, at) => column(at + 2)),
    lost: number(20),
  });
}
