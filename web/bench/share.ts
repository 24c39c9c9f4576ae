// A synthetic share behind a WebSocket that only seems to be one: the page decodes its messages as those of
// the server.
import type { Column } from '../src/wire';
import { random } from '../src/plot/testing';

const BATCH = 16;
const BEAT = 50;
const HEADER = 32;
const PAST_ROWS = 1000;
const SHORT = 1e-4;

export interface Shape {
  line: string;
  motors: number[];
  columns: Column[];
  /** How much of the past a new subscription gets, in seconds. */
  past: number;
  /** One in so many values is a spike. */
  spikes: number;
  /** Seconds in which nothing comes, and how often they begin. */
  pause?: { every: number; length: number };
}

interface Stream {
  subscription: number;
  group: number;
  motor: number;
  columns: Column[];
  period: number;
  next: number;
  number: number;
}

interface Asked {
  id: number;
  ask: string;
  line?: string;
  signals?: { line: string; motor: number; name: string }[];
  period?: number;
  subscription?: number;
}

/** Makes every WebSocket of the page a synthetic share. */
export function install(shape: Shape) {
  const begun = Date.now() / 1000 - 2 * shape.past;
  const now = () => Date.now() / 1000 - begun;
  const next = random(1);

  class Share extends EventTarget {
    static readonly OPEN = 1;
    readonly readyState = Share.OPEN;
    binaryType = 'arraybuffer';
    onmessage: ((event: { data: unknown }) => void) | null = null;
    onclose: (() => void) | null = null;
    private streams: Stream[] = [];
    private groups = 0;
    private subscriptions = 0;
    private beats = 0;
    private at: number | null = null;
    private heard = 0;

    constructor() {
      super();
      setTimeout(() => {
        this.tell({ kind: 'welcome', server: 'synthetic', name: 'page 1', role: 'operator', deadline: 300, run: '1' });
        setInterval(() => this.beat(), BEAT);
        setInterval(() => this.send(), BATCH);
      });
    }

    private tell(text: object) {
      this.onmessage?.({ data: JSON.stringify(text) });
    }

    private beat() {
      this.beats += 1;
      const since = performance.now() - this.heard;
      this.tell({ kind: 'beat', beat: this.beats, wall: Date.now() / 1000, at: this.at, since, holds: false });
    }

    close() {}

    /** What the page sends. */
    ['send'](text?: string) {
      if (text === undefined) return this.streams.forEach((stream) => this.rows(stream));
      const asked = JSON.parse(text) as Asked | { beat: number; at: number };
      if ('beat' in asked) {
        this.at = asked.at;
        this.heard = performance.now();
      } else setTimeout(() => this.answer(asked));
    }

    private answer(asked: Asked) {
      const { id, ask } = asked;
      const answer = (rest: object = {}) => this.tell({ kind: 'answer', id, to: ask, ...rest });
      switch (ask) {
        case 'lines':
          return answer({
            lines: [{ line: shape.line, protocol: 'st', port: 'synthetic', timeout: 1, t: now(), wall: Date.now() / 1000 }],
          });
        case 'motors':
          return answer({ motors: shape.motors });
        case 'signals':
          return answer({ signals: shape.columns });
        case 'subscribe':
          this.subscriptions += 1;
          answer({ subscription: this.subscriptions });
          return this.subscribe(asked);
        case 'unsubscribe':
          this.streams = this.streams.filter(({ subscription }) => subscription !== asked.subscription);
          return answer();
        default:
          return answer();
      }
    }

    private subscribe({ signals = [], period = 1 }: Asked) {
      for (const motor of new Set(signals.map((one) => one.motor))) {
        const names = signals.filter((one) => one.motor === motor).map(({ name }) => name);
        const columns = shape.columns.filter(({ name }) => names.includes(name));
        this.groups += 1;
        const stream = {
          subscription: this.subscriptions, group: this.groups, motor, columns, period, number: 0,
          next: now() - shape.past + SHORT * motor,
        };
        this.tell({ kind: 'group', group: this.groups, subscription: this.subscriptions, line: shape.line, motor, columns });
        this.streams.push(stream);
      }
    }

    private rows(stream: Stream) {
      for (;;) {
        const { every = Infinity, length = 0 } = shape.pause ?? {};
        const phase = stream.next % every;
        if (phase < length) stream.next += length - phase + SHORT;
        const until = Math.min(now(), phase < length ? stream.next + every - length : stream.next + every - phase + stream.period);
        const count = Math.min(Math.floor((until - stream.next) / stream.period), PAST_ROWS);
        if (count < 1) return;
        const t0 = stream.next;
        stream.next += count * stream.period;
        this.onmessage?.({ data: this.message(stream, t0, count) });
      }
    }

    private message({ group, number, columns, period, motor }: Stream, t0: number, count: number): ArrayBuffer {
      const buffer = new ArrayBuffer(HEADER + 8 * count * (columns.length + 2));
      const head = new DataView(buffer);
      [1, group, number, count, columns.length + 2, 0].forEach((word, at) => head.setUint32(4 * at, word, true));
      head.setFloat64(24, t0, true);
      const values = new Float64Array(buffer, HEADER);
      for (let row = 0; row < count; row += 1) {
        const t = t0 + row * period;
        values[row] = row * period;
        values[count + row] = 0.001;
        columns.forEach((_, column) => {
          const spike = next() * shape.spikes < 1 ? 1500 : 0;
          const wave = Math.sin(t * (0.3 + 0.1 * column) + motor) + 0.2 * Math.sin(17 * t);
          values[(column + 2) * count + row] = Math.round(100 * (column + 1) * wave + 40 * next() + spike + 300 * motor);
        });
      }
      return buffer;
    }
  }
  Object.assign(globalThis, { WebSocket: Share });
}
