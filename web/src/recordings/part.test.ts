import { describe, expect, it } from 'vitest';
import { elapsed, fileOf, finer, read, size, splice } from './part';

const head = { from: 0, to: 2, events: [], more_events: 0, damage: null };

function message(kind: number, payload: Uint8Array): Uint8Array {
  const bytes = new Uint8Array(8 + payload.length);
  new DataView(bytes.buffer).setUint32(0, payload.length, true);
  bytes[4] = kind;
  bytes.set(payload, 8);
  return bytes;
}

const text = (value: object) => message(1, new TextEncoder().encode(JSON.stringify(value)));

function samples(group: number, t: number[], values: number[]): Uint8Array {
  const payload = new Uint8Array(32 + 8 * 3 * t.length);
  const view = new DataView(payload.buffer);
  [1, group, 0, t.length, 3, 0].forEach((value, at) => view.setUint32(4 * at, value, true));
  [...t, ...t.map(() => 0), ...values].forEach((value, at) => view.setFloat64(32 + 8 * at, value, true));
  return message(2, payload);
}

function joined(...parts: Uint8Array[]): ArrayBuffer {
  const all = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all.buffer;
}

describe('a part of a recording', () => {
  it('has a text and the samples of signals, at any place of the bytes', () => {
    // The text has a length that is no multiple of 8.
    const part = read(joined(text({ ...head, damage: 'odd' }), samples(7, [0, 1], [5, NaN]), samples(2, [1], [6])));
    expect(part.head.damage).toBe('odd');
    expect([...part.points.keys()]).toEqual([7, 2]);
    expect([...part.points.get(7)!.t]).toEqual([0, 1]);
    expect([...part.points.get(7)!.values]).toEqual([5, NaN]);
  });

  it('is refused if it is cut or of another version', () => {
    const whole = joined(text(head), samples(0, [0, 1], [1, 2]));
    for (let length = 0; length < whole.byteLength; length += 1) {
      const isWhole = length === text(head).length;
      if (isWhole) expect(read(whole.slice(0, length)).points.size).toBe(0);
      else expect(() => read(whole.slice(0, length)), String(length)).toThrow('The server sent');
    }
    const other = new Uint8Array(whole.slice(0));
    other[text(head).length + 8] = 2;
    expect(() => read(other.buffer)).toThrow('cannot be read');
  });
});

describe('a part with more points', () => {
  const points = (t: number[], values: number[]) => ({ t: Float64Array.from(t), values: Float64Array.from(values) });

  it('replaces the points of its time, and no others', () => {
    const whole = points([0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5]);
    const part = points([1.9, 2, 2.5, 3, 3.5, 4, 4.1], [9, 20, 25, 30, 35, 40, 9]);
    const { t, values } = splice(whole, part, { from: 2, to: 4 });
    expect([...t]).toEqual([0, 1, 2, 2.5, 3, 3.5, 4, 5]);
    expect([...values]).toEqual([0, 1, 20, 25, 30, 35, 40, 5]);
  });

  it('is asked for if the shown time is short, and not known well', () => {
    expect(finer({ min: -1, max: 101 }, 100, null)).toBeNull();
    expect(finer({ min: 10, max: 90 }, 100, null)).toBeNull();
    expect(finer({ min: 10, max: 20 }, 100, null)).toEqual({ from: 5, to: 25 });
    expect(finer({ min: 10, max: 20 }, 100, { from: 5, to: 25 })).toBeNull();
    expect(finer({ min: 12, max: 17 }, 100, { from: 5, to: 25 })).toBeNull();
    expect(finer({ min: 12, max: 13 }, 100, { from: 5, to: 25 })).toEqual({ from: 11.5, to: 13.5 });
    expect(finer({ min: 24, max: 34 }, 100, { from: 5, to: 25 })).toEqual({ from: 19, to: 39 });
    // Beside the recording there is nothing.
    expect(finer({ min: -20, max: -10 }, 100, null)).toBeNull();
    expect(finer({ min: -5, max: 5 }, 100, null)).toEqual({ from: 0, to: 10 });
  });
});

describe('texts', () => {
  it('are short and have units', () => {
    expect([999, 349_700, 1_234_567, 2.5e9].map(size)).toEqual(['1.0 kB', '349.7 kB', '1.2 MB', '2.50 GB']);
    expect([0, 9.9, 61, 3600, 36_061].map(elapsed)).toEqual(['00:00', '00:09', '01:01', '1:00:00', '10:01:01']);
    expect(fileOf('Prüf #1/?.mcap')).toBe('api/recordings/Pr%C3%BCf%20%231%2F%3F.mcap');
  });
});
