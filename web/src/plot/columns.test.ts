import { describe, expect, it } from 'vitest';
import { Columns, drawColumns, drawSamples, type Frame } from './columns';
import { BREAK, Samples } from './samples';
import { DASHES } from './style';
import { random } from './testing';

/** A column of `width` seconds is a pixel. */
const plain = (width: number, dash: readonly number[] = [0, 0], stepped = false): Frame => ({
  x: (x) => x / width, y: (y) => -y, dash, stepped,
});

/** What was drawn, as lines in values. */
class Recorder {
  readonly lines: [x0: number, y0: number, x1: number, y1: number][] = [];
  private at: [number, number] = [NaN, NaN];
  moveTo(x: number, y: number) {
    this.at = [x, -y];
  }
  lineTo(x: number, y: number) {
    this.lines.push([...this.at, x, -y]);
    this.at = [x, -y];
  }
  /** The extremes of what was drawn at `x`. */
  reach(x: number, within: number): [number, number] {
    const there = this.lines.flatMap(([x0, y0, x1, y1]) => [[x0, y0], [x1, y1]]).filter(([at]) => Math.abs(at! - x) < within);
    return [Math.min(...there.map(([, y]) => y!)), Math.max(...there.map(([, y]) => y!))];
  }
}

function irregular(next: () => number, count: number): Samples {
  const samples = new Samples();
  let x = 0;
  for (let index = 0; index < count; index += 1) {
    x += next() < 0.01 ? 1 : next() * 0.02;
    samples.push(x, next() < 0.02 ? NaN : next() < 0.005 ? 1e4 * (next() - 0.5) : 10 * next());
  }
  return samples;
}

describe('a spike', () => {
  it.each(DASHES)('is drawn at any span and place, dash %d %d', (...dash) => {
    const next = random(dash[0] + 1);
    const samples = irregular(next, 20_000);
    for (let round = 0; round < 30; round += 1) {
      const span = Math.exp(next() * Math.log(samples.newest));
      const min = next() * (samples.newest - span);
      const width = span / (50 + Math.floor(next() * 1000));
      const first = Math.floor(min / width);
      const last = Math.ceil((min + span) / width);
      const columns = new Columns();
      columns.update(samples, width, first, last);
      const recorder = new Recorder();
      drawColumns(recorder, columns, first, last, plain(width, dash));
      const drawn = new Map<number, { min: number; max: number }>();
      for (const [x0, y0, x1, y1] of recorder.lines) {
        const isDot = y0 === y1 && Math.abs(x1 - x0 - 3) < 1e-6;
        for (const [x, y] of isDot ? ([[(x0 + x1) / 2, y0]] as const) : ([[x0, y0], [x1, y1]] as const)) {
          const k = Math.floor(x);
          const one = drawn.get(k) ?? { min: Infinity, max: -Infinity };
          drawn.set(k, { min: Math.min(one.min, y), max: Math.max(one.max, y) });
        }
      }
      const isRight = (k: number) => {
        const { min: low, max: high } = samples.extremes(samples.at(k * width), samples.at((k + 1) * width));
        const there = drawn.get(k);
        if (there) return there.max <= there.min || (there.min === low && there.max === high);
        if (low > high) return true;
        if (dash[0] === 0) return false;
        // Left out between two dashes, as what was drawn just before is as high and as low.
        const before = [...drawn].filter(([other]) => other < k).slice(-2 * dash[0]).map(([, one]) => one);
        return (
          low >= Math.min(...before.map(({ min: one }) => one)) - 2 && high <= Math.max(...before.map(({ max: one }) => one)) + 2
        );
      };
      const all = Array.from({ length: last - first + 1 }, (_, at) => first + at);
      expect(all.filter((k) => !isRight(k))).toEqual([]);
    }
  });
});

it.each(DASHES)('a spike between dashes is drawn, dash %d %d', (...dash) => {
  for (let place = 100; place < 130; place += 1) {
    for (const step of [1, 0.2]) {
      const samples = new Samples();
      for (let x = 0; x < 200; x += step) samples.push(x, Math.abs(x - place) < step / 2 ? 15 : 5 + (samples.end % 2));
      const byColumn = new Recorder();
      const columns = new Columns();
      columns.update(samples, 1, 0, 199);
      drawColumns(byColumn, columns, 0, 199, plain(1, dash));
      expect(byColumn.lines.some(([, y0, , y1]) => Math.max(y0, y1) === 15)).toBe(true);
      const bySample = new Recorder();
      drawSamples(bySample, samples, 0, samples.end, plain(1, dash), 1);
      expect(bySample.lines.some(([, y0, , y1]) => Math.max(y0, y1) === 15)).toBe(true);
    }
  }
});

describe('columns', () => {
  it('that were kept are the same as new ones, while samples come and the view moves', () => {
    const next = random(5);
    const samples = new Samples(8000);
    const kept = new Columns();
    let x = 0;
    for (let frame = 0; frame < 200; frame += 1) {
      for (let count = Math.floor(next() * 60); count > 0; count -= 1) samples.push((x += next() * 0.02), next() < 0.02 ? NaN : next());
      if (next() < 0.02) samples.blank(x - next());
      const width = 0.1;
      const last = Math.floor(x / width) + 1 - Math.floor(next() * 20);
      const first = last - 100;
      if (first * width < samples.oldest) continue;
      kept.update(samples, width, first, last);
      const fresh = new Columns();
      fresh.update(samples, width, first, last);
      const of = (one: Columns) =>
        Array.from({ length: last - first + 1 }, (_, at) => {
          const slot = one.slot(first + at);
          return one.has[slot] ? [one.min[slot], one.max[slot], one.broken[slot]] : [one.broken[slot]];
        });
      expect(of(kept)).toEqual(of(fresh));
    }
  });

  it('compute again only what is not complete', () => {
    const samples = new Samples();
    for (let index = 0; index < 100_000; index += 1) samples.push(index / 1000, index);
    const columns = new Columns();
    columns.update(samples, 0.1, 0, 999);
    let reads = 0;
    const y = samples.y.bind(samples);
    samples.y = (number) => ((reads += 1), y(number));
    samples.push(100, 0);
    columns.update(samples, 0.1, 1, 1000);
    expect(reads).toBeLessThan(20);
  });
});

describe('a gap', () => {
  const samples = new Samples();
  for (let index = 0; index < 1000; index += 1) {
    if (index === 500) samples.push(4.995, BREAK);
    samples.push(index < 500 ? index / 100 : 10 + index / 100, 5);
  }
  const crosses = (recorder: Recorder) => recorder.lines.some(([x0, , x1]) => x0 < 60 && x1 > 140);

  it('is not joined, sample by sample', () => {
    const recorder = new Recorder();
    drawSamples(recorder, samples, 0, samples.end, plain(0.1), 0.1);
    expect(crosses(recorder)).toBe(false);
    expect(recorder.lines.length).toBeGreaterThan(900);
  });

  it('is not joined, by columns', () => {
    const columns = new Columns();
    columns.update(samples, 0.1, 0, 200);
    const recorder = new Recorder();
    drawColumns(recorder, columns, 0, 200, plain(0.1));
    expect(crosses(recorder)).toBe(false);
  });

  it('is not joined where it begins a column', () => {
    const late = new Samples();
    for (const [x, y] of [[0.5, 5], [10.2, NaN], [10.7, 5]] as const) late.push(x, y);
    const columns = new Columns();
    columns.update(late, 1, 0, 10);
    const recorder = new Recorder();
    drawColumns(recorder, columns, 0, 10, plain(1));
    expect(recorder.lines.map(([x0]) => x0)).toEqual([-1, 9]);
  });

  it('is not there where nothing is missing', () => {
    const sparse = new Samples();
    for (let index = 0; index < 300; index += 1) sparse.push(index, index);
    const columns = new Columns();
    columns.update(sparse, 0.5, 0, 598);
    const recorder = new Recorder();
    drawColumns(recorder, columns, 0, 598, plain(0.5));
    expect(recorder.lines.filter(([x0, , x1]) => x1 - x0 === 2)).toHaveLength(299);
  });

  it('leaves a single value visible', () => {
    const single = new Samples();
    for (const y of [1, NaN, 7, NaN, 1]) single.push(single.end, y);
    const recorder = new Recorder();
    drawSamples(recorder, single, 0, single.end, plain(1), 1);
    expect(recorder.reach(2, 1.6)).toContain(7);
  });
});

describe('dashes', () => {
  it('cover their share of a flat line, in both ways of drawing', () => {
    const samples = new Samples();
    for (let index = 0; index < 10_000; index += 1) samples.push(index / 10, 3);
    const length = ({ lines }: Recorder) => lines.reduce((sum, [x0, , x1]) => sum + Math.abs(x1 - x0), 0);
    for (const dash of DASHES) {
      const share = dash[0] === 0 ? 1 : dash[1] / dash[0];
      const columns = new Columns();
      columns.update(samples, 1, 0, 999);
      const byColumn = new Recorder();
      drawColumns(byColumn, columns, 0, 999, plain(1, dash));
      expect(length(byColumn) / 1000).toBeCloseTo(share, 1);
      const bySample = new Recorder();
      drawSamples(bySample, samples, 0, samples.end, plain(1, dash), 1);
      expect(length(bySample) / 1000).toBeCloseTo(share, 1);
    }
  });
});

it('a reference holds its value until the next one', () => {
  const samples = new Samples();
  samples.push(0, 0);
  samples.push(10, 5);
  const recorder = new Recorder();
  drawSamples(recorder, samples, 0, 2, plain(1, [0, 0], true), 1);
  expect(recorder.lines.slice(-2)).toEqual([[expect.any(Number), 0, 10, 0], [10, 0, 10, 5]]);
});
