import { describe, expect, it } from 'vitest';
import { BREAK, BYTES, Samples } from './samples';
import { random } from './testing';

function filled(count: number, value: (index: number) => number, capacity?: number) {
  const samples = new Samples(capacity);
  for (let index = 0; index < count; index += 1) samples.push(index / 100, value(index));
  return samples;
}

describe('extremes', () => {
  it('are those of a plain search, for any interval, with gaps', () => {
    const next = random(1);
    for (const count of [0, 1, 15, 16, 17, 4095, 4096, 4097, 20_000]) {
      const values = Array.from({ length: count }, () => (next() < 0.05 ? NaN : next() < 0.01 ? BREAK : next() * 100 - 50));
      const samples = filled(count, (index) => values[index]!);
      for (let round = 0; round < 60; round += 1) {
        const from = Math.floor(next() * (count + 1));
        const end = from + Math.floor(next() * (count - from + 1));
        const inside = values.slice(from, end).filter(isFinite);
        const expected = { min: Math.min(Infinity, ...inside), max: Math.max(-Infinity, ...inside) };
        expect(samples.extremes(from, end)).toEqual(expected);
      }
    }
  });

  it('stay right while old samples are dropped', () => {
    const next = random(2);
    const values: number[] = [];
    const samples = new Samples(10_000);
    for (let index = 0; index < 50_000; index += 1) {
      values.push(next());
      samples.push(index, values[index]!);
      if (index % 997 !== 0) continue;
      const from = samples.first + Math.floor(next() * (samples.end - samples.first));
      const { min, max } = samples.extremes(from, samples.end);
      const inside = values.slice(from);
      expect([min, max]).toEqual([Math.min(...inside), Math.max(...inside)]);
    }
  });
});

describe('memory', () => {
  it('is bounded, and keeps what was asked for', () => {
    const samples = filled(200_000, (index) => index, 10_000);
    expect(samples.end - samples.first).toBeGreaterThanOrEqual(10_000);
    expect(samples.end - samples.first).toBeLessThan(10_000 + 8192);
    expect(samples.bytes).toBeLessThan((10_000 + 2 * 4096) * BYTES);
    expect(samples.y(samples.first)).toBe(samples.first);
    samples.resize(1000);
    expect(samples.bytes).toBeLessThan((1000 + 2 * 4096) * BYTES);
    expect(samples.y(samples.end - 1)).toBe(199_999);
  });

  it('is not taken before it is needed', () => {
    expect(filled(10, () => 0, 1_000_000).bytes).toBeLessThan(5000 * BYTES);
  });
});

it('finds the sample at a time', () => {
  const samples = filled(10_000, (index) => index);
  expect(samples.at(-1)).toBe(0);
  expect(samples.at(50)).toBe(5000);
  expect(samples.at(50.001)).toBe(5001);
  expect(samples.at(1e9)).toBe(10_000);
});

it('takes the values of doubtful samples away', () => {
  const samples = filled(10_000, (index) => index);
  const { version } = samples;
  expect(samples.blank(90)).toBe(1000);
  expect(samples.extremes(0, 10_000)).toEqual({ min: 0, max: 8999 });
  expect(samples.y(9000)).toBeNaN();
  expect(samples.version).not.toBe(version);
  expect(samples.blank(95)).toBe(0);
});
