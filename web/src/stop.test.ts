import { type Signal, signal } from '@preact/signals';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';

/** What the test does with a request of the page. */
interface Asked {
  ask: { ask: string };
  done: (answer: object) => void;
  failed: (why: Error) => void;
}

let asked: Asked[];
let welcome: Signal<object | null>;
let posted: { done: (response: Response) => void; failed: (why: Error) => void }[];
let latchedBy: Signal<string | null>;
let held: Signal<boolean>;
let shareLost: Signal<string | null>;
let entries: Signal<object[]>;
const sayAlive = vi.fn();

class Refused extends Error {
  constructor(
    readonly reason: string,
    message: string,
  ) {
    super(message);
  }
}

let stop: typeof import('./stop');

beforeEach(async () => {
  vi.useFakeTimers({ toFake: ['setTimeout', 'performance'] });
  asked = [];
  posted = [];
  // The module of the last test still follows its own.
  welcome = signal({});
  latchedBy = signal(null);
  shareLost = signal(null);
  entries = signal([{ number: 1, event: 'stopped', line: 'st0', motor: 1 }]);
  held = signal(true);
  vi.doMock('./link', () => ({
    Refused,
    entries,
    held,
    latchedBy,
    sayAlive,
    shareLost,
    welcome,
    state: {
      get value() {
        return welcome.value ? 'open' : 'lost';
      },
    },
    lastWelcome: signal({ deadline: 300 }),
    lines: signal([{ line: 'st0' }, { line: 'rmd0' }]),
    motors: signal(new Map([['st0', [1, 2]], ['rmd0', [1, 2]]])),
    ask: (ask: { ask: string }) =>
      welcome.value
        ? new Promise((done, failed) => asked.push({ ask, done, failed }))
        : Promise.reject(new Refused('line', 'There is no connection to the server.')),
  }));
  vi.stubGlobal('fetch', (url: string, options: RequestInit) => {
    expect([url, options]).toEqual(['api/stop-all', { method: 'POST', keepalive: true }]);
    return new Promise((done, failed) => posted.push({ done, failed }));
  });
  vi.resetModules();
  stop = await import('./stop');
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

const pass = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const ALL = [
  { line: 'st0', motor: 1 },
  { line: 'st0', motor: 2 },
  { line: 'rmd0', motor: 1 },
  { line: 'rmd0', motor: 2 },
];
const happened = (event: string, line?: string, motor?: number) =>
  void (entries.value = [...entries.value, { number: entries.value.length + 1, event, line, motor }]);
const report = () => stop.stopReport.value!;

describe('stop all', () => {
  it('is sent at once, and says when the server has it and when all motors confirmed', async () => {
    stop.stopAll();
    expect(asked.map(({ ask }) => ask.ask)).toEqual(['stop-all']);
    expect(held.value).toBe(false);
    expect(report().phase).toBe('sent');
    latchedBy.value = 'page 1';
    expect(report().message).toContain('The server has the stop');
    happened('stopped', 'rmd0', 2);
    expect(report()).toMatchObject({ phase: 'sent', message: expect.stringContaining('1 of 4 did') });
    asked[0]!.done({ motors: ALL });
    await pass(2000);
    expect(report()).toEqual({ phase: 'stopped', message: 'Stopped: 4 of 4 motors confirmed.' });
    expect(posted).toHaveLength(0);
  });

  it('goes by HTTP, too, if there is no answer within 150 ms', async () => {
    stop.stopAll();
    await pass(149);
    expect(posted).toHaveLength(0);
    await pass(2);
    expect(posted).toHaveLength(1);
    posted[0]!.done(Response.json({ motors: ALL }));
    await pass(0);
    expect(report().phase).toBe('stopped');
  });

  it('goes by HTTP at once without a connection', async () => {
    welcome.value = null;
    stop.stopAll();
    await pass(0);
    expect(posted).toHaveLength(1);
  });

  it('says which motors may still be turning', async () => {
    stop.stopAll();
    asked[0]!.done({ motors: ALL.map((one) => (one.motor === 1 ? one : { ...one, failure: 'no reply' })) });
    await pass(0);
    expect(report()).toEqual({
      phase: 'unconfirmed',
      message:
        'st0/2, rmd0/2 did not confirm: they may still be turning. 2 of 4 motors confirmed.',
      failures: ['st0/2: no reply', 'rmd0/2: no reply'],
    });
  });

  it('names the motors that have not confirmed, from 1 s on', async () => {
    stop.stopAll();
    latchedBy.value = 'page 1';
    happened('latched');
    happened('stopped', 'rmd0', 2);
    await pass(990);
    expect(report().message).not.toContain('not yet');
    await pass(20);
    expect(report().phase).toBe('sent');
    expect(report().message).toMatch(/1 of 4 did; not yet: rmd0\/1, st0\/1, st0\/2$/);
    happened('stopped', 'st0', 1);
    expect(report().message).toMatch(/2 of 4 did; not yet: rmd0\/1, st0\/2$/);
  });

  it('names them if none has confirmed and motion was latched before', async () => {
    latchedBy.value = 'page 1';
    stop.stopAll();
    happened('latched');
    await pass(1010);
    expect(report().message).toMatch(/0 of 4 did; not yet: rmd0\/1, rmd0\/2, st0\/1 and 1 more$/);
  });

  it('follows motors that confirm after the answer', async () => {
    stop.stopAll();
    happened('stopped', 'st0', 2);
    happened('stop-failed', 'st0', 2);
    asked[0]!.done({ motors: ALL.map((one) => (one.motor === 1 ? one : { ...one, failure: 'no reply' })) });
    await pass(0);
    expect(report().message).toContain('st0/2, rmd0/2 did not confirm');
    happened('stopped', 'rmd0', 2);
    expect(report()).toEqual({
      phase: 'unconfirmed',
      message: 'st0/2 did not confirm: it may still be turning. 3 of 4 motors confirmed.',
      failures: ['st0/2: no reply'],
    });
    happened('stopped', 'st0', 2);
    expect(report()).toEqual({ phase: 'stopped', message: 'Stopped: 4 of 4 motors confirmed.' });
  });

  it('names the first of many motors, and keeps all of them beside it', async () => {
    stop.stopAll();
    const many = Array.from({ length: 30 }, (_, at) => ({ line: 'rmd1', motor: at + 1, failure: 'no reply' }));
    asked[0]!.done({ motors: [...ALL, ...many] });
    await pass(0);
    expect(report().message).toBe(
      'rmd1/1, rmd1/2, rmd1/3 and 27 more did not confirm: they may still be turning. 4 of 34 motors confirmed.',
    );
    expect(report().failures).toHaveLength(30);
    expect(report().failures!.at(-1)).toBe('rmd1/30: no reply');
  });

  it('does not wait for addresses where no motor was found, and needs no second way then', async () => {
    stop.stopAll();
    happened('latched');
    for (const { line, motor } of ALL) happened('stopped', line, motor);
    expect(report()).toEqual({ phase: 'stopped', message: 'Stopped: 4 of 4 motors confirmed.' });
    await pass(1500);
    expect(posted).toHaveLength(0);
  });

  it('does not count addresses where no motor was found, but motors that may turn', async () => {
    stop.stopAll();
    asked[0]!.done({ motors: [...ALL, { line: 'rmd0', motor: 9, failure: 'no reply' }] });
    await pass(0);
    expect(report().message).toContain('rmd0/9 did not confirm: it may still be turning');
    stop.stopAll();
    asked[1]!.done({ motors: [...ALL, { line: 'rmd0', motor: 9, failure: 'no reply', absent: true }] });
    await pass(0);
    expect(report().phase).toBe('stopped');
    expect(report().message).toBe('Stopped: 4 of 4 motors confirmed.');
    expect(report().note).toBe('The stop also went to 1 address where no motor was found.');
    // The page knows better: a search of this page found it.
    stop.stopAll();
    asked[2]!.done({ motors: [{ line: 'rmd0', motor: 2, failure: 'no reply', absent: true }] });
    await pass(0);
    expect(report().message).toContain('rmd0/2 did not confirm: it may still be turning');
  });

  it('tells a line that never answered from a port that is being opened', async () => {
    stop.stopAll();
    const silent = { line: 'st0', motor: 0, failure: 'nothing on this line has answered' };
    const port = { line: '/dev/ttyUSB0', motor: 0, failure: 'page 2 opens it at this moment' };
    asked[0]!.done({ motors: [silent, port, { line: 'rmd0', motor: 1 }] });
    await pass(0);
    expect(report().message).toBe(
      'Nothing has ever answered on st0: motors there may be turning. ' +
        '/dev/ttyUSB0 is being opened or closed: motors there may be turning. 1 of 1 motors confirmed.',
    );
  });

  it('says that the server is not reachable, whether that fails or hangs', async () => {
    for (const fails of [true, false]) {
      welcome.value = fails ? null : {};
      posted = [];
      stop.stopAll();
      await pass(200);
      if (fails) posted[0]!.failed(new TypeError('no network'));
      await pass(1000);
      expect(report().phase).toBe('unreachable');
      expect(report().message).toContain('its own deadline of 300 ms. If not, they keep turning');
      expect(report().message).toContain('use the power switch or a guard');
    }
    // An answer after all is better news.
    asked.at(-1)!.done({ motors: ALL });
    await pass(0);
    expect(report().phase).toBe('stopped');
  });

  it('is sent again when the connection is back soon, and only then', async () => {
    for (const [gone, count] of [[2000, 1], [20_000, 0]] as const) {
      welcome.value = null;
      asked = [];
      posted = [];
      stop.stopAll();
      await pass(0);
      posted[0]!.failed(new TypeError('no network'));
      await pass(gone);
      welcome.value = {};
      expect(asked).toHaveLength(count);
    }
  });

  it('names the latch as the first obstacle to motion', () => {
    expect(stop.checkLatch).not.toThrow();
    latchedBy.value = 'page 1';
    expect(stop.checkLatch).toThrow('Motion is latched: press Release.');
  });

  it('gives the reason of a server that cannot stop, and what it does when the share is back', async () => {
    const lost = 'the share is lost: it has ended. If it is back within 10 s, the stop is sent';
    for (const isLast of [true, false]) {
      shareLost.value = 'it has ended';
      asked = [];
      posted = [];
      stop.stopAll();
      // The second way has begun, and the answers come in either order.
      await pass(200);
      const byHttp = () => posted[0]!.done(new Response(lost, { status: 503 }));
      if (!isLast) byHttp();
      await pass(0);
      asked[0]!.failed(new Refused('line', lost));
      await pass(0);
      if (isLast) byHttp();
      await pass(2000);
      expect(report()).toEqual({
        phase: 'refused',
        message: `The motors may still be turning. The server could not stop them: ${lost}.`,
      });
      shareLost.value = null;
      asked[1]!.done({ motors: ALL });
      await pass(0);
      expect(report()).toEqual({ phase: 'stopped', message: 'Stopped: 4 of 4 motors confirmed.' });
    }
  });

  it('reports the newest stop only, and forgets it when its latch is released', async () => {
    stop.stopAll();
    stop.stopAll();
    latchedBy.value = 'page 1';
    asked[1]!.done({ motors: ALL });
    await pass(0);
    asked[0]!.done({ motors: [] });
    await pass(0);
    expect(report().message).toContain('4 of 4');
    latchedBy.value = null;
    expect(stop.stopReport.value).toBeNull();
  });
});

describe('the stop of one motor', () => {
  it('is an error unless the motor confirmed it', async () => {
    const stopped = stop.stopMotor('st0', 1);
    asked[0]!.done({ motors: [{ line: 'st0', motor: 1, failure: 'no reply' }] });
    await expect(stopped).rejects.toThrow('It may still be turning');
    const again = stop.stopMotor('st0', 1);
    asked[1]!.done({ motors: [{ line: 'st0', motor: 1 }] });
    await expect(again).resolves.toContain('confirmed');
  });

  it('stops all motors without a connection', async () => {
    welcome.value = null;
    await expect(stop.stopMotor('st0', 1)).resolves.toContain('Stop all');
    await pass(0);
    expect(posted).toHaveLength(1);
  });
});
