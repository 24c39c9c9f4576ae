import { beforeEach, describe, expect, it } from 'vitest';
import type { AnswerTo, Ask, Rows } from '../link';
import type { Description, Event as DriveEvent, MotorName, Register } from '../wire';
import { analyse } from './analysis';
import { Aborted, Experiment, type Plan, type Rig, gainsOf, rampText, referenceOf } from './experiment';

const register = (name: string, more: Partial<Register> = {}): Register =>
  ({
    name, group: '', doc: '', unit: '', readable: true, writable: true, wears_rom: false, range: null, ...more,
  }) as Register;

const DESCRIPTION = {
  line: 'st0', protocol: 'st', commands: [], states: [], faults: [],
  registers: [
    register('SPEED_MEAS', { unit: 'rpm', range: [-1e6, 1e6, 1] }), register('SPEED_REF', { unit: 'rpm' }),
    register('SPEED_KP'), register('SPEED_KP_DIV'), register('PFC_I_KP'), register('STATUS'),
  ],
  modes: [{ mode: 'speed', unit: 'rpm', measured: 'SPEED_MEAS', most: 30000 }],
} as unknown as Description;
const MOTOR: MotorName = { line: 'st0', motor: 1 };
const PLAN: Plan = {
  motor: MOTOR, description: DESCRIPTION, controlled: DESCRIPTION.modes[0]!, from: 500, to: 1000, duration: 1,
  approach: 500, after: 'stop',
};

/** A motor whose speed follows the reference with a time constant, in virtual time. */
class Bench implements Rig {
  now = 100;
  speed = 0;
  reference = 0;
  target = 0;
  rate = Infinity;
  asked: string[] = [];
  stops = 0;
  happened: DriveEvent[] = [];
  onRows: ((rows: Rows) => void) | null = null;
  onRefused: (why: Error) => void = () => {};
  /** Called before each wait. */
  onWait = () => {};
  refuse: Record<string, string> = {};
  swing = 0;
  hasReference = true;
  isStreamed = false;
  next: { at: number; target: number; rate: number } | null = null;

  async ask<A extends Ask>(wanted: A): Promise<AnswerTo<A['ask']>> {
    const why = this.refuse[wanted.ask];
    this.asked.push(wanted.ask === 'run' ? `run ${wanted.target}` : wanted.ask);
    if (why) throw new Error(why);
    const answers: Partial<Record<Ask['ask'], () => unknown>> = {
      read: () => ({ values: [{ name: 'SPEED_KP', value: 12, text: '12' }, { name: 'SPEED_KP_DIV', value: null, text: 'refused' }] }),
      rates: () => ({ rates: [{ ...MOTOR, name: 'SPEED_MEAS', asked: 1e-4, predicted: 0.002, achieved: 500 }] }),
      run: () => {
        if (wanted.ask !== 'run') throw new Error('no run');
        this.say(this.now);
        if (this.isStreamed) {
          // The measured value, and the next reference 20 ms later.
          this.next = { at: this.now + 0.02, target: wanted.target, rate: wanted.rate };
        } else {
          this.target = wanted.target;
          this.rate = wanted.rate;
          this.say(this.now + 0.004);
        }
        return { from: this.speed };
      },
    };
    return answers[wanted.ask]!() as AnswerTo<A['ask']>;
  }

  private say(t: number) {
    this.happened.push({
      wall: 0, line: 'st0', motor: 1, t, by: 'page 1 (control)', event: 'commanded', message: 'SET_RAMP',
    });
  }

  subscribe(_: unknown, period: number, onRows: (rows: Rows) => void, onRefused: (why: Error) => void) {
    expect(period).toBe(1e-4);
    this.onRows = onRows;
    this.onRefused = onRefused;
    return () => (this.onRows = null);
  }

  async stop() {
    this.stops += 1;
    this.target = 0;
    this.rate = Infinity;
    if (this.refuse.stop) throw new Error(this.refuse.stop);
    return 'Stopped: the motor confirmed it.';
  }

  events = () => this.happened;
  name = () => 'page 1';

  async wait(seconds: number) {
    this.onWait();
    const [t, y, reference]: number[][] = [[], [], []];
    const end = this.now + seconds;
    while (this.now < end - 1e-9) {
      this.now += 0.002;
      if (this.next && this.now >= this.next.at) {
        this.say(this.next.at);
        ({ target: this.target, rate: this.rate } = this.next);
        this.next = null;
      }
      const most = this.rate * 0.002;
      this.reference += Math.max(-most, Math.min(most, this.target - this.reference));
      this.speed += (this.reference - this.speed) * (1 - Math.exp(-0.002 / 0.05));
      t!.push(this.now);
      y!.push(Math.round(this.speed + this.swing * Math.sin(4 * this.now)));
      reference!.push(this.reference);
    }
    const rows = { line: 'st0', motor: 1, t0: 0, lost: 0, span: Float64Array.from(t!, () => 0.001) };
    const give = (name: string, values: number[], later: number) =>
      this.onRows?.({
        ...rows, columns: [{ name, unit: 'rpm' }], t: Float64Array.from(t!, (time) => time + later),
        values: [Float64Array.from(values)],
      });
    give('SPEED_MEAS', y!, 0);
    if (this.hasReference) give('SPEED_REF', reference!, 0.001);
  }
}

let bench: Bench;
let progress: string[];
const experiment = (plan: Partial<Plan> = {}) =>
  new Experiment({ ...PLAN, ...plan }, bench, (text) => progress.push(text));

beforeEach(() => {
  bench = new Bench();
  progress = [];
});

describe('a step', () => {
  it('goes to the start, steps, records and stops', async () => {
    const one = experiment();
    const run = await one.run();
    expect(bench.asked).toEqual(['read', 'run 500', 'run 1000', 'rates']);
    expect([bench.stops, one.isMoving]).toEqual([1, false]);
    expect(bench.onRows).toBeNull();
    expect(run).toMatchObject({ from: 500, to: 1000, unit: 'rpm', resolution: 1, carried: 0.002, lost: 0 });
    expect(run.gains).toEqual([{ name: 'SPEED_KP', text: '12', unit: '' }]);
    expect(run.reference).not.toBeNull();
    expect(run.t[0]).toBeLessThan(-0.5);
    expect(run.t.at(-1)).toBeGreaterThan(0.99);
    const { figures } = analyse({
      ...run, y: run.y.map((value) => value ?? NaN), at: [-run.doubt, run.doubt],
    });
    const rise = figures.rise;
    if (rise.kind !== 'value') throw new Error(rise.why);
    expect(Math.abs(rise.value - Math.log(9) * 0.05)).toBeLessThan(rise.error);
    const delay = figures.delay;
    if (delay.kind !== 'value') throw new Error(delay.why);
    expect(Math.abs(delay.value - Math.log(2) * 0.05)).toBeLessThan(delay.error);
  });

  it('ends at the start if that is wanted, and the motor keeps turning', async () => {
    const one = experiment({ after: 'from' });
    await one.run();
    expect(bench.asked.at(-1)).toBe('run 500');
    expect([bench.stops, one.isMoving]).toEqual([0, true]);
  });

  it('from 0 does not start a motor at rest before', async () => {
    await experiment({ from: 0 }).run();
    expect(bench.asked.filter((one) => one.startsWith('run'))).toEqual(['run 1000']);
  });

  it('has the time of the command, and the drive\'s own reference makes it more exact', async () => {
    // SET_RAMP, and START_MOTOR 4 ms later.
    expect((await experiment().run()).doubt).toBeLessThan(0.002);
    bench = new Bench();
    bench.hasReference = false;
    const run = await experiment().run();
    expect(run.doubt).toBeCloseTo(0.0025, 6);
  });

  it('of an RMD motor is the last reference, not the measured value before it', async () => {
    bench.hasReference = false;
    bench.isStreamed = true;
    const run = await experiment({ description: { ...DESCRIPTION, protocol: 'rmd' } }).run();
    expect(run.doubt).toBeCloseTo(0.0005, 6);
    const after = run.y.findIndex((value, index) => run.t[index]! > -0.1 && value! > 505);
    expect(run.t[after]).toBeGreaterThan(0);
    expect(run.t[after]).toBeLessThan(0.006);
  });

  it('of another program is not taken for this one', async () => {
    const ask = bench.ask.bind(bench);
    bench.ask = async (wanted) => {
      const answer = await ask(wanted);
      for (const one of bench.happened) {
        if (one.by === 'page 1 (control)') one.by = 'page 10 (control)';
      }
      return answer;
    };
    bench.hasReference = false;
    // Only the samples before and after the answer are known then.
    const { doubt } = await experiment().run();
    expect(doubt).toBeGreaterThan(0.02);
    expect(doubt).toBeLessThan(0.1);
  });
});

describe('what ends a step stops the motor', () => {
  it.each(['Going to', 'Waiting', 'Applying', 'Recording'])('when it is aborted: %s', async (phase) => {
    const one = experiment();
    bench.onWait = () => {
      if (progress.at(-1)?.startsWith(phase)) one.abort('The tab was hidden.');
    };
    const failure = await one.run().catch((why: unknown) => why);
    expect(failure).toBeInstanceOf(Aborted);
    expect((failure as Error).message).toBe('Aborted. The tab was hidden. Stopped: the motor confirmed it.');
    expect([bench.stops, one.isMoving, bench.onRows]).toEqual([1, false, null]);
  });

  it('and nothing is moved if that was before', async () => {
    const one = experiment();
    one.abort('The view was left.');
    await expect(one.run()).rejects.toThrow('Aborted. The view was left. Nothing was moved.');
    expect(bench.stops).toBe(0);
    expect(bench.asked.filter((asked) => asked.startsWith('run'))).toEqual([]);
  });

  it('when the drive refuses to move', async () => {
    bench.refuse.run = 'motor 1 refused SET_RAMP: BUSY';
    await expect(experiment().run()).rejects.toThrow('motor 1 refused SET_RAMP: BUSY. Stopped: the motor confirmed it.');
    expect(bench.stops).toBe(1);
  });

  it('when the value is never steady', async () => {
    bench.swing = 200;
    await expect(experiment().run()).rejects.toThrow(/not steady 15 s after.*Stopped/);
    expect(bench.stops).toBe(1);
  });

  it('when the motor lost its power on the way to the start: the step does not start it again', async () => {
    bench.onWait = () => {
      if (progress.at(-1)?.startsWith('Waiting')) [bench.target, bench.rate] = [0, Infinity];
    };
    await expect(experiment().run()).rejects.toThrow('The motor is at 0.0 rpm, not at 500: it may have lost its power. Stopped');
    expect(bench.asked).not.toContain('run 1000');
    expect(bench.stops).toBe(1);
  });

  it('when values end', async () => {
    bench.onWait = () => {
      if (progress.at(-1)?.startsWith('Recording')) bench.onRows = null;
    };
    await expect(experiment().run()).rejects.toThrow(/no more values\. Stopped/);
  });

  it('when values are doubtful', async () => {
    bench.onWait = () => {
      const isTold = bench.happened.some(({ event }) => event === 'doubtful');
      if (!progress.at(-1)?.startsWith('Recording') || isTold) return;
      bench.happened.push({ wall: 0, line: 'st0', motor: 1, event: 'doubtful', message: 'values may be those of other signals' });
    };
    await expect(experiment().run()).rejects.toThrow(/not used: values may be.*Repeat the step\. Stopped/);
    expect(bench.stops).toBe(1);
  });

  it('when signals are refused', async () => {
    bench.onWait = () => bench.onRefused(new Error('too many signals'));
    await expect(experiment().run()).rejects.toThrow('too many signals. Nothing was moved.');
  });

  it('and says so if the stop is not confirmed', async () => {
    const one = experiment();
    bench.refuse.stop = 'no reply from motor 1. It may still be turning.';
    bench.onWait = () => {
      if (progress.at(-1)?.startsWith('Recording')) one.abort('The tab was hidden.');
    };
    await expect(one.run()).rejects.toThrow(/stop is not confirmed: no reply.*still be turning/);
    expect(one.isMoving).toBe(true);
  });
});

describe('a description', () => {
  it('says which registers are gains, and which is the reference', () => {
    expect(gainsOf(DESCRIPTION).map(({ name }) => name)).toEqual(['SPEED_KP', 'SPEED_KP_DIV']);
    expect(referenceOf(DESCRIPTION, DESCRIPTION.modes[0]!)).toBe('SPEED_REF');
    expect(referenceOf(DESCRIPTION, { mode: 'speed', unit: '°/s', measured: 'speed_dps', most: 1 })).toBeNull();
  });

  it('and the limits of the drive say which ramp it adds', () => {
    const gain = (text: string) => [{ name: 'acceleration', text, unit: '°/s²' }];
    expect(rampText(PLAN, [])).toMatch(/at once. No ramp/);
    expect(rampText(PLAN, gain('0'))).toMatch(/has no limit/);
    expect(rampText(PLAN, gain('600'))).toBe('The drive limits the acceleration to 600 °/s².');
    const position = { ...PLAN, approach: 90, controlled: { mode: 'position' as const, unit: '°', measured: 'angle', most: 1 } };
    expect(rampText(position, gain('600'))).toMatch(/at most 90 °\/s/);
  });
});
