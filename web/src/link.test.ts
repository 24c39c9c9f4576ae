import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { Rows } from './link';

/** A WebSocket whose other end is the test. */
class Socket {
  static OPEN = 1;
  static all: Socket[] = [];
  static get last(): Socket {
    return Socket.all.at(-1)!;
  }
  readyState = 0;
  sent: Record<string, unknown>[] = [];
  onmessage: ((event: { data: string | ArrayBuffer }) => void) | null = null;
  onclose: (() => void) | null = null;
  constructor(readonly url: URL) {
    Socket.all.push(this);
  }
  send(text: string) {
    this.sent.push(JSON.parse(text) as Record<string, unknown>);
  }
  close() {
    this.readyState = 3;
  }
  /** Gives the page a text. */
  give(text: object) {
    this.onmessage?.({ data: JSON.stringify(text) });
  }
  welcome(more: object = {}) {
    this.readyState = 1;
    this.give({ kind: 'welcome', server: 'm', name: 'page 1', role: 'operator', deadline: 300, separate_share: false, run: 'r', ...more });
  }
  /** What the page asked for. */
  asked(kind: string) {
    return this.sent.filter(({ ask }) => ask === kind);
  }
  get signs() {
    return this.sent.filter(({ frame }) => frame !== undefined);
  }
}

type Link = typeof import('./link');
let link: Link;
let frames: (() => void)[];
let hidden: boolean;
const listeners = new Map<string, () => void>();
const beacon = vi.fn();

/** The browser draws a frame. */
function draw() {
  const now = frames;
  frames = [];
  now.forEach((frame) => frame());
}

let lastBeat = 0;
function beat(more: object = {}) {
  lastBeat += 1;
  Socket.last.give({ kind: 'beat', beat: lastBeat, wall: Date.now() / 1000, at: performance.now(), since: 0, holds: false, ...more });
}

/** Time passes on a connection that lives. */
function live(ms: number) {
  for (let passed = 0; passed < ms; passed += 50) {
    beat();
    draw();
    vi.advanceTimersByTime(50);
  }
}

beforeEach(async () => {
  vi.useFakeTimers({ toFake: ['setTimeout', 'setInterval', 'clearInterval', 'performance', 'Date'] });
  Socket.all = [];
  frames = [];
  hidden = false;
  listeners.clear();
  beacon.mockClear();
  vi.stubGlobal('WebSocket', Socket);
  vi.stubGlobal('location', { href: 'http://127.0.0.1:8707/', protocol: 'http:' });
  vi.stubGlobal('requestAnimationFrame', (frame: () => void) => frames.push(frame));
  vi.stubGlobal('document', {
    get hidden() {
      return hidden;
    },
    addEventListener: (type: string, listener: () => void) => listeners.set(type, listener),
  });
  vi.stubGlobal('addEventListener', (type: string, listener: () => void) => listeners.set(type, listener));
  vi.stubGlobal('navigator', { sendBeacon: beacon });
  vi.resetModules();
  link = await import('./link');
  link.start();
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

const SIGNAL = { line: 'st0', motor: 1, name: 'SPEED_MEAS' };
const GROUP = { kind: 'group', group: 7, subscription: 3, line: 'st0', motor: 1, columns: [{ name: 'SPEED_MEAS', unit: 'rpm' }] };

/** The example of docs/SHARE-PROTOCOL.md, of another group. */
function example(group: number): ArrayBuffer {
  const bytes = new DataView(new ArrayBuffer(32 + 8 * 2 * 3));
  [1, group, 0, 2, 3, 5].forEach((value, at) => bytes.setUint32(4 * at, value, true));
  [12.25, 0, 0.01, 0.001, 0.001, 1500, 1501].forEach((value, at) => bytes.setFloat64(24 + 8 * at, value, true));
  return bytes.buffer;
}

function answerSubscribe(subscription: number) {
  const { id } = Socket.last.asked('subscribe').at(-1)!;
  Socket.last.give({ kind: 'answer', id, to: 'subscribe', subscription });
}

describe('requests', () => {
  it('reject while there is no connection, and when it ends', async () => {
    await expect(link.ask({ ask: 'lines' })).rejects.toMatchObject({ reason: 'line' });
    Socket.last.welcome();
    const answer = link.ask({ ask: 'rates' });
    Socket.last.onclose!();
    await expect(answer).rejects.toThrow('unknown whether');
  });

  it('to the share reject when it is lost; the server still answers its own', async () => {
    Socket.last.welcome();
    const stop = link.ask({ ask: 'stop', motor: { line: 'st0', motor: 1 } });
    const all = link.ask({ ask: 'stop-all' });
    Socket.last.give({ kind: 'share', lost: 'it has ended' });
    await expect(stop).rejects.toThrow('The share was lost');
    Socket.last.give({ kind: 'answer', id: Socket.last.asked('stop-all')[0]!.id, to: 'stop-all', motors: [] });
    await expect(all).resolves.toMatchObject({ motors: [] });
  });

  it('give the sentence of the server', async () => {
    Socket.last.welcome();
    const answer = link.ask({ ask: 'release' });
    const { id } = Socket.last.asked('release')[0]!;
    Socket.last.give({ kind: 'refusal', id, reason: 'forbidden', message: 'a viewer may not' });
    await expect(answer).rejects.toMatchObject({ reason: 'forbidden', message: 'a viewer may not' });
  });
});

describe('subscriptions', () => {
  it('decode rows, and survive reconnections', () => {
    const got: Rows[] = [];
    link.subscribe([SIGNAL], 0.01, (rows) => got.push(rows));
    for (const run of ['r', 'other']) {
      Socket.last.welcome({ run });
      answerSubscribe(3);
      Socket.last.give(GROUP);
      Socket.last.onmessage!({ data: example(7) });
      expect(got).toHaveLength(1);
      const [rows] = got.splice(0);
      expect(rows).toMatchObject({ line: 'st0', motor: 1, t0: 12.25, lost: 5 });
      expect([...rows!.t]).toEqual([0, 0.01]);
      expect([...rows!.values[0]!]).toEqual([1500, 1501]);
      Socket.last.onclose!();
      vi.advanceTimersByTime(1000);
    }
    expect(Socket.all).toHaveLength(3);
  });

  it('begin again when the share was lost, and only then', () => {
    link.subscribe([SIGNAL], 0.01, () => {});
    Socket.last.welcome();
    Socket.last.give({ kind: 'share', lost: null });
    expect(Socket.last.asked('subscribe')).toHaveLength(1);
    Socket.last.give({ kind: 'share', lost: 'the share has ended' });
    Socket.last.give({ kind: 'share', lost: null });
    expect(Socket.last.asked('subscribe')).toHaveLength(2);
  });

  it('end at the share, also if its answer comes later', () => {
    const end = link.subscribe([SIGNAL], 0.01, () => {});
    Socket.last.welcome();
    end();
    answerSubscribe(3);
    expect(Socket.last.asked('unsubscribe')).toMatchObject([{ subscription: 3 }]);
  });

  it('are tried again after a refusal', () => {
    const refused = vi.fn();
    link.subscribe([SIGNAL], 0.01, () => {}, { onRefused: refused });
    Socket.last.welcome();
    const { id } = Socket.last.asked('subscribe')[0]!;
    Socket.last.give({ kind: 'refusal', id, reason: 'usage', message: 'no line st0' });
    expect(refused).toHaveBeenCalledOnce();
    live(11_000);
    expect(Socket.last.asked('subscribe')).toHaveLength(2);
  });

  it('ignore samples of unknown groups and of wrong sizes', () => {
    const got = vi.fn();
    link.subscribe([SIGNAL], 0.01, got);
    Socket.last.welcome();
    answerSubscribe(3);
    Socket.last.give(GROUP);
    Socket.last.onmessage!({ data: example(8) });
    Socket.last.onmessage!({ data: example(7).slice(0, 70) });
    Socket.last.onmessage!({ data: new ArrayBuffer(3) });
    expect(got).not.toHaveBeenCalled();
  });
});

describe('motors', () => {
  const answer = (kind: string, more: object) => {
    const { id } = Socket.last.asked(kind).at(-1)!;
    Socket.last.give({ kind: 'answer', id, to: kind, ...more });
    return vi.advanceTimersByTimeAsync(0);
  };
  const LINE = { line: 'st0', protocol: 'st', port: 'p', timeout: 1, t: 10, wall: 0 };

  it('that answered before are known while no search finds them', async () => {
    Socket.last.welcome();
    await answer('lines', { lines: [{ ...LINE, heard: [2, 1], unstopped: [3] }] });
    expect(link.motors.value.get('st0')).toEqual([1, 2, 3]);
    expect(link.searching.value.has('st0')).toBe(true);
    const { id } = Socket.last.asked('motors').at(-1)!;
    Socket.last.give({ kind: 'refusal', id, reason: 'silent', message: 'no motor answers' });
    await vi.advanceTimersByTimeAsync(0);
    expect(link.motors.value.get('st0')).toEqual([1, 2, 3]);
    expect(link.searchFailed.value.get('st0')).toBe('no motor answers');
    // They are searched again later.
    void link.refreshLines();
    await answer('lines', { lines: [{ ...LINE, heard: [1, 2] }] });
    expect(Socket.last.asked('motors')).toHaveLength(2);
    await answer('motors', { motors: [1] });
    expect([link.motors.value.get('st0'), link.found.value.get('st0')]).toEqual([[1, 2], [1]]);
  });

  it('without an answer are those that a search found', async () => {
    Socket.last.welcome();
    await answer('lines', { lines: [LINE] });
    expect(link.motors.value.has('st0')).toBe(false);
    await answer('motors', { motors: [] });
    expect(link.motors.value.get('st0')).toEqual([]);
  });

  it('that confirm a stop, or do not, are asked for once', async () => {
    Socket.last.welcome();
    const before = Socket.last.asked('lines').length;
    for (const motor of [1, 2]) {
      Socket.last.give({ kind: 'event', wall: 1, event: 'stop-failed', line: 'st0', motor, message: '' });
    }
    await vi.advanceTimersByTimeAsync(100);
    expect(Socket.last.asked('lines')).toHaveLength(before + 1);
  });
});

describe('ages', () => {
  const age = () => link.age(link.wallAt('st0', 10));
  const lines = (t: number) => {
    const { id } = Socket.last.asked('lines').at(-1)!;
    const wall = Date.now() / 1000;
    Socket.last.give({ kind: 'answer', id, to: 'lines', lines: [{ line: 'st0', protocol: 'st', port: 'p', timeout: 1, t, wall }] });
    return vi.advanceTimersByTimeAsync(0);
  };

  it('are unknown before the clocks are known, and grow while nothing is received', async () => {
    Socket.last.welcome();
    expect(age()).toBeNaN();
    await lines(10);
    expect(age()).toBeNaN();
    beat();
    expect(age()).toBeCloseTo(0);
    vi.advanceTimersByTime(3000);
    expect(age()).toBeCloseTo(3);
  });

  it('stay those of a value when another share begins the clocks anew', async () => {
    Socket.last.welcome();
    await lines(10);
    beat();
    const read = link.wallAt('st0', 10);
    vi.advanceTimersByTime(3000);
    Socket.last.give({ kind: 'event', wall: 1, event: 'back', line: 'st0', message: '' });
    await lines(0.5);
    expect(link.age(read)).toBeCloseTo(3);
  });

  it('of a time to come are unknown: it is of another clock', async () => {
    Socket.last.welcome();
    await lines(10);
    beat();
    expect(link.age(link.wallAt('st0', 10.5))).toBeCloseTo(-0.5);
    expect(link.age(link.wallAt('st0', 30))).toBeNaN();
  });
});

describe('signs of life', () => {
  it('name the beat that the page had when it drew the frame', () => {
    Socket.last.welcome();
    beat();
    draw();
    beat();
    vi.advanceTimersByTime(100);
    expect(Socket.last.signs.at(-1)).toMatchObject({ beat: lastBeat - 1, frame: 1, held: false });
    draw();
    vi.advanceTimersByTime(100);
    expect(Socket.last.signs.at(-1)).toMatchObject({ beat: lastBeat, frame: 2 });
  });

  it('have no new frame when none is drawn', () => {
    Socket.last.welcome();
    live(500);
    const { frame } = Socket.last.signs.at(-1)!;
    for (let step = 0; step < 10; step += 1) {
      beat();
      vi.advanceTimersByTime(100);
    }
    expect(Socket.last.signs.at(-1)).toMatchObject({ frame });
  });

  it('follow the first frame after a pause at once', () => {
    Socket.last.welcome();
    live(500);
    vi.advanceTimersByTime(200);
    const before = Socket.last.signs.length;
    beat();
    draw();
    expect(Socket.last.signs).toHaveLength(before + 1);
    expect(Socket.last.signs.at(-1)).toMatchObject({ beat: lastBeat });
    draw();
    expect(Socket.last.signs).toHaveLength(before + 1);
  });

  it('give the motors up when the page is hidden or left', () => {
    Socket.last.welcome();
    link.held.value = true;
    hidden = true;
    listeners.get('visibilitychange')!();
    expect(Socket.last.asked('let-go')).toHaveLength(1);
    expect(link.held.value).toBe(false);
    listeners.get('pagehide')!();
    expect(beacon).toHaveBeenCalledWith('api/let-go?run=r&page=page+1');
  });
});

describe('the connection', () => {
  it('is silent when beats stop or are late, and open again when they are in time', () => {
    Socket.last.welcome();
    live(300);
    expect(link.state.value).toBe('open');
    vi.advanceTimersByTime(700);
    expect(link.state.value).toBe('silent');
    expect(link.delay.value).toBeGreaterThan(500);
    beat({ at: performance.now() - 4000 });
    vi.advanceTimersByTime(100);
    expect(link.state.value).toBe('silent');
    expect(link.delay.value).toBeCloseTo(4000);
    live(200);
    expect(link.state.value).toBe('open');
  });

  it('is given up after 5 s of silence, and replaced', () => {
    Socket.last.welcome();
    const first = Socket.last;
    vi.advanceTimersByTime(5300);
    expect(link.state.value).toBe('lost');
    expect(first.readyState).toBe(3);
    vi.advanceTimersByTime(1000);
    expect(Socket.last).not.toBe(first);
    Socket.last.welcome();
    expect(link.state.value).toBe('open');
    // What the old one still gives is ignored.
    first.onclose!();
    first.give({ kind: 'event', wall: 0, event: 'latched', by: 'old', message: '' });
    expect(link.state.value).toBe('open');
    expect(link.latchedBy.value).toBeNull();
  });

  it('that never opens is given up, too', () => {
    vi.advanceTimersByTime(6300);
    expect(Socket.all.length).toBe(2);
  });

  it('takes the commands of a ramp as one entry, and counts them', () => {
    Socket.last.welcome();
    const give = (wall: number, motor: number, more: object = {}) =>
      Socket.last.give({ kind: 'event', wall, event: 'commanded', line: 'rmd0', motor, by: 'p', message: `${wall}`, ...more });
    for (let step = 0; step < 10; step += 1) {
      give(step / 50, 1);
      give(step / 50, 2);
    }
    give(2, 1);
    give(2, 1, { by: 'other' });
    give(2, 1, { by: 'other', event: 'stopped' });
    expect(link.events.value).toHaveLength(23);
    expect(link.entries.value).toMatchObject([
      { number: 1, motor: 1, times: 10, wall: 0, until: 0.18, message: '0.18' },
      { number: 2, motor: 2, times: 10 },
      { number: 3, motor: 1, times: 1 },
      { number: 4, by: 'other', times: 1 },
      { number: 5, event: 'stopped', times: 1 },
    ]);
  });

  it('takes only the same command as one more of a row', () => {
    Socket.last.welcome();
    const give = (wall: number, text: string) =>
      Socket.last.give({ kind: 'event', wall, event: 'commanded', line: 'st0', motor: 1, by: 'p', message: `st0, motor 1: p sends ${text}` });
    give(0, 'SET_RAMP 1500 rpm, 1000 ms');
    give(0.01, 'EXECUTE_CMD START_MOTOR');
    give(0.02, 'SET_RAMP -1200.5 rpm, 900 ms');
    give(0.03, 'SET_REG SPEED_KP = 300');
    give(0.04, 'SET_REG SPEED_KI = 300');
    expect(link.entries.value.map(({ message, times }) => [message.split('sends ')[1], times])).toEqual([
      ['SET_RAMP -1200.5 rpm, 900 ms', 2], ['EXECUTE_CMD START_MOTOR', 1], ['SET_REG SPEED_KP = 300', 1], ['SET_REG SPEED_KI = 300', 1],
    ]);
  });

  it('knows the latch from events, and the motors of a new server from a new search', async () => {
    Socket.last.welcome();
    Socket.last.give({ kind: 'event', wall: 1, event: 'latched', by: 'page 2', message: 'page 2 latched' });
    expect(link.latchedBy.value).toBe('page 2');
    Socket.last.give({ kind: 'event', wall: 2, event: 'released', by: 'page 2', message: 'page 2 released' });
    expect(link.latchedBy.value).toBeNull();
    Socket.last.give({ kind: 'missed', events: 12 });
    expect(link.events.value.at(-1)!.message).toContain('12 events');
    link.motors.value = new Map([['st0', [1]]]);
    Socket.last.onclose!();
    vi.advanceTimersByTime(1000);
    Socket.last.welcome({ run: 'other' });
    expect(link.motors.value.size).toBe(0);
  });
});
