import { beforeEach, expect, it, vi } from 'vitest';
import type { Run } from './run';

const recorded = (points = 2000): Omit<Run, 'number' | 'analysis' | 'isThinned'> => {
  const t = Array.from({ length: points }, (_, index) => -0.5 + (index * 2) / points);
  return {
    when: 1_795_413_600_000, motor: { line: 'st0', motor: 1 }, mode: 'speed', unit: 'rpm', measured: 'SPEED_MEAS',
    from: 500, to: 1000, t, y: t.map((time) => (time < 0 ? 500 : 1000 - 500 * Math.exp(-time / 0.05))),
    reference: t.map((time) => (time < 0 ? 500 : 1000)), doubt: 0.0005, resolution: 0,
    gains: [{ name: 'SPEED_KP', text: '12', unit: 's16A/unit' }], carried: 0.001, lost: 0, ramp: 'none',
  };
};

let kept: Map<string, string>;
let most: number;

beforeEach(() => {
  kept = new Map();
  most = Infinity;
  vi.stubGlobal('localStorage', {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, text: string) => {
      if (text.length > most) throw new DOMException('full', 'QuotaExceededError');
      kept.set(key, text);
    },
  });
  vi.resetModules();
});

it('keeps runs, the newest first, and not more than 12', async () => {
  const { add, remove, runs } = await import('./run');
  for (let index = 0; index < 14; index += 1) add(recorded());
  expect(runs.value.map(({ number }) => number)).toEqual([14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3]);
  remove(13);
  expect(runs.value).toHaveLength(11);

  vi.resetModules();
  const later = await import('./run');
  expect(later.runs.value.map(({ number }) => number)).toEqual([14, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3]);
  expect(later.runs.value[0]!.analysis.figures.rise).toEqual(runs.value[0]!.analysis.figures.rise);
});

it('keeps fewer if the browser has no room, and all as long as the page is open', async () => {
  const { add, runs } = await import('./run');
  add(recorded());
  most = 1.5 * [...kept.values()][0]!.length;
  add(recorded());
  expect(runs.value).toHaveLength(2);
  expect(JSON.parse([...kept.values()][0]!)).toHaveLength(1);
});

it('thins long runs for the browser, not the analysis', async () => {
  const { add } = await import('./run');
  const run = add(recorded(20_000));
  expect(run.isThinned).toBe(false);
  const [stored] = JSON.parse([...kept.values()][0]!) as Run[];
  expect(stored!.isThinned).toBe(true);
  expect(stored!.t.length).toBeLessThanOrEqual(3000);
  expect(stored!.y).toHaveLength(stored!.t.length);
  expect(stored!.analysis.samples).toBe(run.analysis.samples);
});

it.each(['{', '5', '[null,{"number":1}]', '[{"number":1,"t":[1],"y":[],"gains":[]}]'])(
  'ignores what it cannot read: %s', async (text) => {
    kept.set('motorlink.steps.1', text);
    expect((await import('./run')).runs.value).toEqual([]);
  },
);

it('writes CSV and JSON with the gains and the definitions', async () => {
  const { add, csv, fileName, json } = await import('./run');
  const run = add({ ...recorded(50), y: recorded(50).y.map((value, index) => (index === 3 ? null : value)) });
  const lines = csv(run).split('\n');
  expect(lines[0]).toBe('# step response of motor 1 of st0, speed from 500 to 1000 rpm');
  expect(lines).toContain('# SPEED_KP = 12 s16A/unit');
  expect(lines).toContain('t_s,SPEED_MEAS,reference');
  expect(lines.filter((line) => !line.startsWith('#'))[4]).toBe('-0.380000,,500');
  expect(fileName(run, 'csv')).toBe('step-1-st0-1-speed.csv');
  const object = JSON.parse(json(run));
  expect(object).toMatchObject({ number: 1, when: '2026-11-23T06:00:00.000Z' });
  expect(object.definitions.rise.doc).toBe('From 10 % to 90 % of the way.');
});

it('gives numbers as many digits as their error has', async () => {
  const { figureText } = await import('./run');
  expect(figureText({ kind: 'value', value: 0.04373, error: 0.0021 }, 's')).toBe('43.7 ± 2.1 ms');
  expect(figureText({ kind: 'value', value: -0.0004, error: 0.55 }, 'rpm')).toBe('0.00 ± 0.55 rpm');
  expect(figureText({ kind: 'value', value: 1.234, error: 0.26 }, 's')).toBe('1234 ± 260 ms');
  expect(figureText({ kind: 'value', value: 16.3, error: 0 }, '%')).toBe('16.30 ± 0.00 %');
  expect(figureText({ kind: 'below', bound: 0.0123, why: '' }, 's')).toBe('below 12 ms');
  expect(figureText({ kind: 'none', why: '' }, 's')).toBe('no number');
});
