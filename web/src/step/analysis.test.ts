import { describe, expect, it } from 'vitest';
import { analyse, type Analysis, type Figure, type FigureName, type Recording } from './analysis';

/** Numbers from 0 to 1, the same in each run. */
function random(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

function gaussian(next: () => number): number {
  return Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next());
}

/** Unit step response of w² / (s² + 2 z w s + w²). */
const secondOrder = (z: number, w: number) => (t: number) => {
  if (t <= 0) return 0;
  if (z === 1) return 1 - Math.exp(-w * t) * (1 + w * t);
  const d = w * Math.sqrt(1 - z * z);
  return 1 - Math.exp(-z * w * t) * (Math.cos(d * t) + ((z * w) / d) * Math.sin(d * t));
};
const firstOrder = (tau: number) => (t: number) => (t <= 0 ? 0 : 1 - Math.exp(-t / tau));

interface Shape {
  from?: number;
  to?: number;
  length?: number;
  interval?: number;
  resolution?: number;
  noise?: number;
  uneven?: boolean;
  doubt?: number;
}

function record(response: (t: number) => number, shape: Shape = {}): Recording {
  const { from = 500, to = 1000, length = 1, interval = 0.001, resolution = 0, noise = 0 } = shape;
  const next = random(7);
  const [t, y]: number[][] = [[], []];
  for (let time = -0.3; time < length; ) {
    let value = from + (to - from) * response(time) + noise * gaussian(next);
    if (resolution) value = Math.round(value / resolution) * resolution;
    t!.push(100 + time);
    y!.push(value);
    time += interval * (shape.uneven ? 0.2 + 1.6 * next() : 1);
  }
  const doubt = shape.doubt ?? 0;
  return { t: t!, y: y!, at: [100 - doubt, 100 + doubt], from, to, resolution };
}

function value(analysis: Analysis, name: FigureName): number {
  const figure = analysis.figures[name];
  if (figure.kind !== 'value') throw new Error(`${name}: ${JSON.stringify(figure)}`);
  return figure.value;
}

function why(figure: Figure): string {
  if (figure.kind === 'value') throw new Error(`a value: ${figure.value}`);
  return figure.why;
}

/** When a function crosses a level for the first time, by small steps and bisection. */
function reaches(response: (t: number) => number, level: number): number {
  let low = 0;
  while (response(low + 1e-4) < level) low += 1e-4;
  let high = low + 1e-4;
  for (let round = 0; round < 50; round += 1) {
    const middle = (low + high) / 2;
    if (response(middle) < level) low = middle;
    else high = middle;
  }
  return high;
}

/** When a response is outside a band for the last time. */
function settles(response: (t: number) => number, band: number, length: number): number {
  let at = length;
  while (Math.abs(response(at) - 1) <= band) at -= 1e-5;
  return at;
}

describe('second-order responses', () => {
  it.each([0.2, 0.5, 0.9])('of damping %d', (damping) => {
    const w = 60;
    const length = 2;
    const response = secondOrder(damping, w);
    const result = analyse(record(response, { length }));
    const overshoot = 100 * Math.exp((-Math.PI * damping) / Math.sqrt(1 - damping ** 2));
    expect(value(result, 'overshoot')).toBeCloseTo(overshoot, 1);
    expect(value(result, 'rise')).toBeCloseTo(reaches(response, 0.9) - reaches(response, 0.1), 4);
    expect(value(result, 'delay')).toBeCloseTo(reaches(response, 0.5), 4);
    expect(value(result, 'settling5')).toBeCloseTo(settles(response, 0.05, length), 3);
    expect(value(result, 'settling2')).toBeCloseTo(settles(response, 0.02, length), 3);
    expect(value(result, 'steadyError')).toBeCloseTo(0, 2);
    expect(result.remarks).toEqual([]);
  });

  it('of critical damping, which has no overshoot', () => {
    const w = 40;
    const result = analyse(record(secondOrder(1, w)));
    expect(value(result, 'rise')).toBeCloseTo(3.3579 / w, 4);
    expect(value(result, 'delay')).toBeCloseTo(1.6783 / w, 4);
    expect(value(result, 'settling2')).toBeCloseTo(5.8339 / w, 3);
    expect(value(result, 'settling5')).toBeCloseTo(4.7439 / w, 3);
    expect(result.figures.overshoot.kind).toBe('below');
  });

  it('of the first order', () => {
    const tau = 0.05;
    const result = analyse(record(firstOrder(tau)));
    expect(value(result, 'rise')).toBeCloseTo(Math.log(9) * tau, 4);
    expect(value(result, 'delay')).toBeCloseTo(Math.log(2) * tau, 4);
    expect(value(result, 'settling2')).toBeCloseTo(Math.log(50) * tau, 3);
    expect(value(result, 'settling5')).toBeCloseTo(Math.log(20) * tau, 3);
  });

  it('downwards, through zero', () => {
    const result = analyse(record(secondOrder(0.5, 60), { from: 400, to: -200 }));
    expect(value(result, 'overshoot')).toBeCloseTo(16.303, 1);
    expect(value(result, 'steadyError')).toBeCloseTo(0, 2);
  });

  it('with a dead time, which is part of the delay', () => {
    const response = firstOrder(0.05);
    const result = analyse(record((t) => response(t - 0.02)));
    expect(value(result, 'delay')).toBeCloseTo(0.02 + Math.log(2) * 0.05, 4);
    expect(value(result, 'rise')).toBeCloseTo(Math.log(9) * 0.05, 4);
  });
});

describe('samples as drives give them', () => {
  const response = secondOrder(0.5, 30);
  const rise = reaches(response, 0.9) - reaches(response, 0.1);

  it('are uneven', () => {
    const result = analyse(record(response, { interval: 0.004, uneven: true }));
    expect(Math.abs(value(result, 'rise') - rise)).toBeLessThan(0.0005);
    expect(Math.abs(value(result, 'overshoot') - 16.303)).toBeLessThan(0.5);
  });

  it('are quantised: the error says how far the numbers can be wrong', () => {
    const result = analyse(record(response, { resolution: 6, interval: 0.003 }));
    for (const [name, truth] of [['rise', rise], ['overshoot', 16.303]] as const) {
      const figure = result.figures[name];
      if (figure.kind !== 'value') throw new Error(name);
      expect(Math.abs(figure.value - truth)).toBeLessThanOrEqual(figure.error);
      expect(figure.error).toBeLessThan(truth / 2);
    }
    expect(result.resolution).toBe(6);
  });

  it('have a resolution that is seen if it is larger than that of the register', () => {
    const recording = record(response, { resolution: 6, interval: 0.003 });
    expect(analyse({ ...recording, resolution: 0 }).resolution).toBe(6);
    expect(analyse({ ...recording, resolution: 1 }).resolution).toBe(6);
    expect(analyse(record(response, { noise: 2 })).resolution).toBe(0);
  });

  it('swing by one step at the end: the band holds them', () => {
    const recording = record(response, { resolution: 6, from: 1000, to: 1199, interval: 0.002 });
    const y = Array.from(recording.y, (value, index) => (recording.t[index]! > 100.5 ? 1197 + 6 * (index % 2) : value));
    const result = analyse({ ...recording, y });
    expect(Math.abs(value(result, 'settling5') - settles(response, 0.05, 1))).toBeLessThan(0.02);
    expect(result.remarks).toEqual([]);
  });

  it('are repeated between updates of the drive', () => {
    const held = record((t) => response(Math.floor(t / 0.01) * 0.01), { interval: 0.002 });
    const result = analyse(held);
    expect(result.update).toBeCloseTo(0.01, 3);
    const figure = result.figures.rise;
    if (figure.kind !== 'value') throw new Error('rise');
    expect(figure.error).toBeGreaterThan(0.005);
    expect(Math.abs(figure.value - rise)).toBeLessThanOrEqual(figure.error);
  });

  it('are noisy: most numbers of many records are within their errors', () => {
    const result = analyse(record(response, { noise: 4 }));
    const figure = result.figures.rise;
    if (figure.kind !== 'value') throw new Error('rise');
    expect(Math.abs(figure.value - rise)).toBeLessThanOrEqual(2 * figure.error);
    expect(Math.abs(value(result, 'overshoot') - 16.303)).toBeLessThan(3);
    expect(why(result.figures.settling2)).toMatch(/fills the band/);
    expect(result.noise).toBeGreaterThan(3);
    expect(result.noise).toBeLessThan(5);
  });

  it('have values that are missing', () => {
    const recording = record(response);
    const y = Array.from(recording.y, (one, index) => (index % 3 ? one : NaN));
    expect(Math.abs(value(analyse({ ...recording, y }), 'rise') - rise)).toBeLessThan(0.001);
  });

  it('have a gap', () => {
    const recording = record(response);
    const t = Array.from(recording.t, (time) => (time > 100.5 ? time + 0.2 : time));
    expect(analyse({ ...recording, t }).remarks.join()).toMatch(/gap of 20\d ms/);
  });

  it('have a gap at the highest value: the overshoot is uncertain, or not given', () => {
    const peak = Math.PI / (30 * Math.sqrt(0.75));
    const without = (half: number) => {
      const recording = record(response);
      const kept = Array.from(recording.t, (_, index) => index).filter(
        (index) => Math.abs(recording.t[index]! - 100 - peak) > half,
      );
      return analyse({ ...recording, t: kept.map((at) => recording.t[at]!), y: kept.map((at) => recording.y[at]!) });
    };
    const { overshoot } = without(0.012).figures;
    if (overshoot.kind !== 'value') throw new Error(overshoot.why);
    expect(overshoot.value + overshoot.error).toBeGreaterThan(16.303);
    expect(overshoot.error).toBeGreaterThan(1);
    expect(why(without(0.035).figures.overshoot)).toMatch(/may be in a gap/);
  });

  it('may be there between the earliest and the latest time of the step', () => {
    const result = analyse({ ...record(response), at: [99.999, 100.03] });
    expect(Math.abs(value(result, 'rise') - rise)).toBeLessThan(0.001);
  });

  it('do not say exactly when the step was', () => {
    const result = analyse(record(response, { doubt: 0.02 }));
    const { delay } = result.figures;
    if (delay.kind !== 'value') throw new Error('delay');
    expect(delay.error).toBeGreaterThan(0.02);
    expect(result.remarks.join()).toMatch(/±20 ms/);
  });
});

describe('numbers that the data do not carry are refused', () => {
  const all = (result: Analysis, words: RegExp) => {
    for (const figure of Object.values(result.figures)) expect(why(figure)).toMatch(words);
  };

  it('without a step', () => {
    all(analyse(record(() => 0, { noise: 2 })), /did not follow/);
    all(analyse(record(() => 0)), /did not follow/);
  });

  it('of a step below the noise', () => {
    all(analyse(record(firstOrder(0.05), { from: 500, to: 505, noise: 8 })), /smaller than noise/);
  });

  it('of a step below the resolution', () => {
    all(analyse(record(firstOrder(0.05), { from: 500, to: 504, resolution: 6 })), /smaller than noise/);
  });

  it('in the wrong direction', () => {
    all(analyse(record((t) => -firstOrder(0.05)(t))), /opposite direction/);
  });

  it('with a value that still drifts', () => {
    all(analyse(record(firstOrder(0.6))), /still changes/);
  });

  it('with a value that still swings', () => {
    all(analyse(record((t) => (t < 0 ? 0 : 1 - Math.cos(60 * t)))), /not settled/);
  });

  it('with too few samples', () => {
    all(analyse(record(firstOrder(0.05), { interval: 0.08 })), /samples before the step/);
    all(analyse(record(firstOrder(0.05), { interval: 0.05 })), /samples in the last fifth/);
    all(analyse({ t: [], y: [], at: [0, 0], from: 0, to: 1, resolution: 0 }), /samples/);
  });

  it('of a rise that is faster than the samples: it gives a bound', () => {
    const result = analyse(record(firstOrder(0.001), { interval: 0.01 }));
    const { rise } = result.figures;
    expect(rise).toMatchObject({ kind: 'below' });
    expect(rise.kind === 'below' && rise.bound).toBeLessThanOrEqual(0.0201);
  });

  it('of a value that settles in the last fifth', () => {
    const late = (t: number) => (t < 0 ? 0 : t < 0.81 ? 1.03 : 1);
    expect(why(analyse(record(late)).figures.settling2)).toMatch(/last fifth/);
  });
});

describe('remarks', () => {
  it('a value that is limited ends before the reference', () => {
    const result = analyse(record((t) => Math.min(firstOrder(0.05)(t), 0.8)));
    expect(value(result, 'steadyError')).toBeCloseTo(100, 1);
    expect(result.remarks.join()).toMatch(/does not reach the reference/);
  });

  it('a value that is limited in its rate rises in a straight line', () => {
    const result = analyse(record((t) => Math.max(0, Math.min(1, t / 0.3))));
    expect(value(result, 'rise')).toBeCloseTo(0.24, 3);
    expect(result.remarks.join()).toMatch(/straight line/);
  });

  it('a value that did not start where the step began', () => {
    const recording = record(firstOrder(0.05));
    expect(analyse({ ...recording, from: 400 }).remarks.join()).toMatch(/not at the start/);
  });
});
