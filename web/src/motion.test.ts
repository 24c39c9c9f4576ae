import { describe, expect, it, vi } from 'vitest';
import type { Entry } from './link';
import type { Description } from './wire';

vi.mock('./link', () => ({}));
vi.mock('./overview', () => ({}));
const { endOf, endOfReferences, stateSince } = await import('./motion');

const entry = (number: number, event: string, more: Partial<Entry> = {}): Entry => ({
  number, event, wall: 0, until: 0, times: 1, line: 'st0', motor: 1, by: 'page 1', message: event, ...more,
} as Entry);

describe('the end of a motion', () => {
  it.each(['stopping', 'stopped', 'stop-failed', 'silent'])('is %s of the motor', (event) => {
    expect(endOf([entry(4, 'commanded'), entry(5, event)], 3, 'st0', 1, 'page 1')?.event).toBe(event);
  });
  it('is the loss or the close of the line', () => {
    const lost = entry(5, 'lost', { motor: null });
    expect(endOf([lost], 3, 'st0', 1, 'page 1')).toBe(lost);
    expect(endOf([lost], 3, 'rmd0', 1, 'page 1')).toBeUndefined();
  });
  it('is the command of another program', () => {
    for (const by of ['tuner', 'page 11 (control)']) {
      expect(endOf([entry(5, 'commanded', { by })], 3, 'st0', 1, 'page 1')?.by).toBe(by);
    }
  });
  it('is no event before it, of another motor, or of its own ramp', () => {
    const all = [entry(3, 'stopped'), entry(4, 'stopped', { motor: 2 }), entry(5, 'commanded', { by: 'page 1 (control)' })];
    expect(endOf(all, 3, 'st0', 1, 'page 1')).toBeUndefined();
  });
});

describe('the end of references of the server', () => {
  const ran = { line: 'rmd0', motor: 4, reference: 112.6 };
  it('is the target', () => {
    expect(endOfReferences({ ...ran, reference: 360 }, '°/s')).toEqual({
      tone: 'ok', text: 'Running. The reference has reached 360 °/s.',
    });
  });
  it('is a value in between, with the reason', () => {
    const failure = 'no reply from motor 4; the motor confirmed its stop';
    expect(endOfReferences({ ...ran, failure }, '°/s')).toEqual({
      tone: 'bad', text: `The reference got no further than 113 °/s: ${failure}.`,
    });
  });
});

describe('the state of a motion', () => {
  const description = {
    overview: { state: 'STATUS' }, states: [{ value: 0, name: 'IDLE' }, { value: 6, name: 'RUN' }],
  } as unknown as Description;
  const stateAt = (age: number, begun: number, value = 6) =>
    stateSince({ age: () => age, values: new Map([['STATUS', { value, unit: '', wall: 0 }]]) }, description, begun);

  it('is one that was read since the motion began', () => {
    expect(stateAt(0.2, 0.5)).toBe('RUN');
    expect(stateAt(0.2, 0.5, 0)).toBe('IDLE');
    // The end of a stop before the motion.
    expect(stateAt(0.2, 0.1, 0)).toBeUndefined();
  });
  it('is not an old or unknown one', () => {
    expect(stateAt(1.5, 9)).toBeUndefined();
    expect(stateAt(NaN, 9)).toBeUndefined();
    expect(stateAt(0.2, 9, 5)).toBeUndefined();
  });
});
