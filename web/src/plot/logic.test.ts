// Small parts: the window of time, keys, settings, rows, CSV, search, texts, colours.
import { describe, expect, it } from 'vitest';
import { csv, iso } from './csv';
import { age, dayClock, duration, onAxis, secondsClock, value } from './format';
import { type Actions, press } from './keys';
import { between, valueAt } from './readings';
import { rows, rowsBefore } from './rows';
import { BREAK, Samples } from './samples';
import { candidates } from './search';
import { DEFAULTS, load, MOST_SIGNALS, parse, remembers, save, usual } from './settings';
import { DASHES, numbered, styleOf } from './style';
import { random } from './testing';
import { Window } from './window';

const samplesOf = (points: readonly (readonly [x: number, y: number])[]) => {
  const samples = new Samples();
  for (const [x, y] of points) samples.push(x, y);
  return samples;
};

describe('the window', () => {
  const live = () => {
    const window = new Window(10, true, 0.001, 600);
    window.follow(100);
    return window;
  };

  it('says which cursors are outside, and shows them', () => {
    const window = live();
    [window.a, window.b] = [95, null];
    expect([window.isOutside(window.a), window.isOutside(window.b)]).toEqual([false, false]);
    window.follow(110);
    expect(window.isOutside(window.a)).toBe(true);
    window.showCursors();
    expect([window.live, window.min, window.max]).toEqual([false, 90, 100]);
    window.b = 130;
    window.showCursors();
    expect([window.isOutside(window.a), window.isOutside(window.b)]).toEqual([false, false]);
    [window.a, window.b] = [null, null];
    window.show(0, 1);
    window.showCursors();
    expect([window.min, window.max]).toEqual([0, 1]);
  });

  it('follows the newest values, and never trembles', () => {
    const window = live();
    expect([window.min, window.max]).toEqual([90, 100]);
    window.follow(99.99);
    window.follow(NaN);
    expect(window.max).toBe(100);
    window.follow(50);
    expect(window.max).toBe(50);
  });

  it('stands still when it is paused, and comes back', () => {
    const window = live();
    window.pause();
    window.follow(200);
    expect([window.min, window.max]).toEqual([90, 100]);
    window.resume(30);
    expect([window.min, window.max]).toEqual([170, 200]);
  });

  it('zooms around a place, and stays live', () => {
    const window = live();
    window.zoom(0.5, 95);
    expect([window.min, window.max, window.live]).toEqual([95, 100, true]);
    window.pause();
    window.zoom(2, 96);
    expect([window.min, window.max]).toEqual([94, 104]);
  });

  it('has limits', () => {
    const window = live();
    for (let count = 0; count < 100; count += 1) window.zoom(2);
    expect(window.span).toBe(600);
    for (let count = 0; count < 100; count += 1) window.zoom(0.5);
    expect(window.span).toBeCloseTo(0.001, 9);
    window.show(5, 5);
    expect(window.max - window.min).toBeCloseTo(0.001, 9);
  });

  it('pans back to live at the end', () => {
    const window = live();
    window.pan(0.5);
    expect(window.live).toBe(true);
    window.pan(-0.5);
    expect([window.min, window.max, window.live]).toEqual([85, 95, false]);
    window.pan(0.3);
    expect([window.max, window.live]).toEqual([98, false]);
    window.pan(0.3);
    expect([window.max, window.live]).toEqual([100, true]);
  });
});

describe('keys', () => {
  const setUp = () => {
    const window = new Window(10, true, 0.001, 600);
    window.follow(100);
    const done: string[] = [];
    const actions: Actions = {
      step: (x, direction) => x + direction,
      oldest: () => 3,
      home: () => done.push('home'),
      pick: (x) => done.push(`pick ${x}`),
    };
    const key = (name: string, rest: Partial<KeyboardEvent> = {}) =>
      press({ key: name, shiftKey: false, ctrlKey: false, metaKey: false, altKey: false, ...rest }, window, actions);
    return { window, done, key };
  };

  it('move both cursors', () => {
    const { window, key, done } = setUp();
    expect(key('Enter')).toBe(false);
    key('ArrowLeft');
    expect(window.a).toBe(95);
    key('ArrowLeft');
    key('.');
    expect(window.a).toBeCloseTo(95.9, 9);
    key('ArrowRight', { shiftKey: true });
    key('<', { shiftKey: true });
    expect(window.b).toBe(94);
    key('Enter');
    expect(done).toEqual([`pick ${window.a}`]);
    key('Delete');
    expect([window.a, window.b]).toEqual([null, null]);
  });

  it('bring a cursor that leaves into view', () => {
    const { window, key } = setUp();
    window.a = 90.05;
    key('ArrowLeft');
    expect(window.min).toBeLessThan(window.a);
    expect(window.live).toBe(false);
  });

  it('zoom, pan, pause', () => {
    const { window, key, done } = setUp();
    key('+');
    expect(window.span).toBeCloseTo(10 / 1.5, 9);
    key('-');
    key('PageUp');
    expect(window.max).toBe(95);
    key('Home');
    expect(window.min).toBe(3);
    key('End');
    key('p');
    expect(done).toEqual(['home', 'home']);
    window.resume();
    key('p');
    expect(window.live).toBe(false);
  });

  it('leave those that stop motors and those of the browser alone', () => {
    const { key } = setUp();
    for (const name of [' ', 'Escape', 'Tab', 'F5', 'ArrowUp', 'ArrowDown']) expect(key(name)).toBe(false);
    for (const modifier of ['ctrlKey', 'metaKey', 'altKey']) expect(key('ArrowLeft', { [modifier]: true })).toBe(false);
  });
});

describe('settings', () => {
  const storage = (text: string | null) => {
    let kept = text;
    return { getItem: () => kept, setItem: (_: string, to: string) => void (kept = to) };
  };

  it('survive', () => {
    const place = storage(null);
    const settings = { signals: [{ line: 'st0', motor: 1, name: 'SPEED_MEAS', rate: 100 }], span: 60, layout: 'unit' as const };
    save(place, settings);
    expect(load(place)).toEqual(settings);
  });

  it.each([null, '', '{', '[]', 'null', '3', '"x"', '{"signals":3,"span":"x","layout":7}', '{"span":1e9}'])(
    'that are broken are ignored: %s',
    (text) => expect(load(storage(text))).toEqual(DEFAULTS),
  );

  it('keep the signals that make sense', () => {
    const good = { line: 'st0', motor: 1, name: 'A', rate: 100 };
    const bad = [null, 1, {}, { ...good, motor: -1 }, { ...good, motor: 1.5 }, { ...good, line: '' }, { ...good, name: 'x'.repeat(1000) }];
    expect(parse({ signals: [...bad, good, good, { ...good, name: 'B', rate: 12345 }] }).signals).toEqual([
      good,
      { ...good, name: 'B', rate: 20 },
    ]);
    const many = Array.from({ length: 500 }, (_, index) => ({ ...good, name: `S${index}` }));
    expect(parse({ signals: many }).signals).toHaveLength(MOST_SIGNALS);
  });

  it('are remembered once they are saved', () => {
    const place = storage(null);
    expect(remembers(place)).toBe(false);
    save(place, DEFAULTS);
    expect(remembers(place)).toBe(true);
  });

  it('begin with the speeds of the first motors that are described', () => {
    const motors = [{ line: 'st0', motor: 1 }, { line: 'can0', motor: 3 }, { line: 'x0', motor: 1 }];
    const speedOf = (line: string) => ({ st0: 'SPEED_MEAS', can0: 'speed_dps' })[line];
    expect(usual(motors, speedOf).map(({ line, motor, name }) => `${line}/${motor} ${name}`)).toEqual([
      'st0/1 SPEED_MEAS', 'can0/3 speed_dps',
    ]);
    const many = Array.from({ length: 36 }, (_, motor) => ({ line: 'st0', motor }));
    expect(usual(many, speedOf)).toHaveLength(6);
    expect(usual([], speedOf)).toEqual([]);
  });

  it('do not hurt where nothing can be stored', () => {
    const refuses = { getItem: () => { throw new Error('denied'); }, setItem: () => { throw new Error('full'); } };
    expect(load(refuses)).toEqual(DEFAULTS);
    expect(remembers(refuses)).toBe(false);
    save(refuses, DEFAULTS);
  });
});

describe('rows', () => {
  const sources = [
    { line: 'a', samples: samplesOf([[1, 10], [2, 20], [2.5, BREAK], [3, NaN], [4, 40]]) },
    { line: 'a', samples: samplesOf([[2, 200], [3, 300]]) },
    { line: 'b', samples: samplesOf([[2, 2000], [5, 5000]]) },
  ];

  it('have the samples of one instant of a line', () => {
    expect([...rows(sources, 1.5, 4)]).toEqual([
      { x: 2, line: 'a', values: [20, 200, undefined] },
      { x: 2, line: 'b', values: [undefined, undefined, 2000] },
      { x: 3, line: 'a', values: [NaN, 300, undefined] },
      { x: 4, line: 'a', values: [40, undefined, undefined] },
    ]);
  });

  it('before a time are the last ones', () => {
    const next = random(3);
    const many = [1, 5, 200].map((rate, index) => {
      const points: [number, number][] = [];
      for (let x = next(); x < 20; x += (0.5 + next()) / rate) points.push([x, x]);
      return { line: `l${index}`, samples: samplesOf(points) };
    });
    for (let round = 0; round < 50; round += 1) {
      const min = next() * 10;
      const x = min + next() * 10;
      const all = [...rows(many, min, x)].filter((row) => row.x < x);
      expect(rowsBefore(many, min, x, 20)).toEqual(all.slice(-20));
    }
  });
});

describe('csv', () => {
  const trace = (name: string, unit: string, points: [number, number][]) => ({
    key: name, name, unit, line: 'st0', samples: samplesOf(points), style: styleOf(0), stepped: false, shown: true, old: false,
  });

  it('has units in its header, both times and quoted names', async () => {
    const origin = 1_800_000_000;
    const traces = [trace('SPEED', 'rpm', [[1, 5], [2.000001, -0.1]]), trace('a "b", c', '', [[1, NaN]])];
    const parts = await csv(traces, 0, 9, {
      header: ['time', 'line', 'line_seconds'],
      times: (x, line) => [iso(origin, x), line, x.toFixed(6)],
    });
    expect(parts.join('')).toBe(
      'time,line,line_seconds,SPEED (rpm),"a ""b"", c"\r\n' +
      '2027-01-15T08:00:01.000000Z,st0,1.000000,5,\r\n' +
      '2027-01-15T08:00:02.000001Z,st0,2.000001,-0.1,\r\n',
    );
  });

  it('pauses for other work', async () => {
    let pauses = 0;
    const points = Array.from({ length: 40_000 }, (_, index): [number, number] => [index, index]);
    const parts = await csv([trace('A', '', points)], 0, 1e9, { header: [], times: () => [] }, async () => void (pauses += 1));
    expect(parts.join('').split('\r\n')).toHaveLength(40_002);
    expect(pauses).toBeGreaterThan(1);
    expect(pauses).toBe(parts.length - 2);
  });
});

describe('readings', () => {
  const samples = samplesOf([[1, 10], [2, 20], [3, NaN], [4, 40]]);
  it.each([
    [1, 10], [1.4, 10], [1.6, 20], [2, 20], [2.05, 20], [2.5, NaN], [3, NaN], [3.5, NaN], [3.95, 40], [4.05, 40], [4.5, NaN], [0.95, 10], [0.5, NaN],
  ])('at %d is %d', (x, expected) => expect(valueAt(samples, x, 0.1)).toBe(expected));

  it('hold, if the curve is one of steps', () => expect(valueAt(samples, 1.9, 0.1, true)).toBe(10));

  it('have a difference and a frequency', () => {
    expect(between(1, null)).toBeNull();
    expect(between(1, 1.25)).toEqual({ dt: 0.25, frequency: 4 });
    expect(between(2, 1)!.dt).toBe(-1);
  });
});

describe('search', () => {
  const motors = new Map([['st0', [1, 2]], ['rmd0', [12]]]);
  const catalogue = new Map([
    ['st0', [{ name: 'RAMP_FINAL_SPEED', unit: 'rpm' }, { name: 'SPEED_MEAS', unit: 'rpm' }]],
    ['rmd0', [{ name: 'speed_dps', unit: '°/s' }]],
  ]);
  const found = (text: string) => candidates(motors, catalogue, text).map(({ line, motor, name }) => `${line} ${motor} ${name}`);

  it('finds by each word', () => {
    expect(found('')).toHaveLength(5);
    expect(found('meas ST0 2')).toEqual(['st0 2 SPEED_MEAS']);
    expect(found('rmd0/12 speed')).toEqual(['rmd0 12 speed_dps']);
    expect(found('rpm')).toHaveLength(4);
    expect(found('nothing')).toEqual([]);
  });

  it('finds one motor by its line and its number', () => {
    const two = new Map([['st0', [1, 2, 11]]]);
    const digits = new Map([['st0', [{ name: 'TORQUE_MEAS', unit: 's16A', doc: '' }]]]);
    const motorsOf = (text: string) => candidates(two, digits, text).map(({ motor }) => motor);
    expect(motorsOf('st0/1 torque')).toEqual([1]);
    expect(motorsOf('ST0/2')).toEqual([2]);
    expect(motorsOf('st0/')).toEqual([1, 2, 11]);
    expect(motorsOf('t0/1')).toEqual([]);
  });

  it('has names that begin with a word first', () => {
    expect(found('st0 1 speed')).toEqual(['st0 1 SPEED_MEAS', 'st0 1 RAMP_FINAL_SPEED']);
  });
});

describe('texts', () => {
  it.each([
    [NaN, '–'], [0, '0'], [-1500, '−1500'], [0.1234567, '0.1235'], [12.345678, '12.3457'], [1234.56789, '1234.57'],
    [123456.789, '123457'], [1e-7, '1.0000e-7'], [4294967295, '4294967295'],
  ])('of the value %d', (number, text) => expect(value(number)).toBe(text));

  it.each([[1e-4, '100 µs'], [-0.02, '−20.00 ms'], [1.5, '1.500 s'], [125, '2 min 5.0 s'], [NaN, '–']])(
    'of the duration %d', (seconds, text) => expect(duration(seconds)).toBe(text),
  );

  it('of an age', () => expect([NaN, 3.9, 300].map(age)).toEqual(['no value yet', '3 s old', '5 min old']));

  it('of times', () => {
    const origin = new Date(2026, 10, 23, 12, 0, 0).getTime() / 1000;
    const { tick, full } = dayClock(origin);
    expect(tick(61, 1)).toBe('12:01:01');
    expect(tick(61.25, 0.25)).toBe('12:01:01.25');
    expect([0, 0.25, 0.5, 0.75, 1].map((split) => onAxis(split, 0.25))).toEqual(['0.00', '0.25', '0.50', '0.75', '1.00']);
    expect([onAxis(2.5, 2.5), onAxis(-20, 10), onAxis(0.3, 0.1)]).toEqual(['2.5', '−20', '0.3']);
    expect(tick(61.25, 0.05)).toBe('12:01:01.25');
    expect(full(59.99999)).toBe('12:01:00.0000');
    expect(secondsClock.tick(-0.5, 0.1)).toBe('−0.5 s');
  });
});

describe('curves', () => {
  it('differ, 40 of them, and neighbours in colour and dashes', () => {
    const styles = Array.from({ length: 40 }, (_, index) => styleOf(index));
    expect(new Set(styles.map(({ light, dash }) => `${light} ${dash.join()}`)).size).toBe(40);
    styles.slice(1).forEach(({ light, dash }, index) => {
      expect(light).not.toBe(styles[index]!.light);
      expect(dash).not.toBe(styles[index]!.dash);
    });
    expect(DASHES.every(([period, part]) => part <= period)).toBe(true);
  });

  it('keep their look while others come and go', () => {
    const first = numbered(['a', 'b', 'c'], new Map());
    expect(numbered(['d', 'c', 'b'], first)).toEqual(new Map([['c', 2], ['b', 1], ['d', 0]]));
  });
});
