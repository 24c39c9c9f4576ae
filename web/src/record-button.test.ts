import { describe, expect, it, vi } from 'vitest';
import type { Recorded } from './wire';

vi.mock('./link', () => ({}));
vi.mock('./parts', () => ({}));
const { gapsText, isActive, missing, rateText, summary } = await import('./record-button');

const recording: Recorded = {
  name: '2026-11-23T14-05-09Z.mcap', phase: 'recording', by: 'page 1', began: 0, seconds: 75.3, bytes: 1_234_567,
  values: 10, lost: 0, unconfirmed: 0, rates: null, slowest: null, gaps: [], motors: [], silent: [], refused: [], left_out: [], message: null,
};

describe('the recording in the header', () => {
  it('says its time and size', () => {
    expect(summary(recording)).toBe('REC 01:15 1.2 MB');
    expect(summary({ ...recording, phase: 'starting' })).toMatch(/^REC starts/);
  });

  it('is on from its start to the end of its file', () => {
    const on = (['starting', 'recording', 'ending', 'ended', 'failed'] as const).map((phase) =>
      isActive({ ...recording, phase }));
    expect(on).toEqual([true, true, true, false, false]);
    expect(isActive(null)).toBe(false);
  });

  it('says what is missing', () => {
    expect(missing(recording)).toBe('');
    expect(missing({ ...recording, lost: 3, silent: ['st0/motor1'], left_out: ['rmd0'] })).toBe(
      '3 lost; no values of st0/1; no motor answered on rmd0',
    );
  });

  it('says the rate of the slowest motor', () => {
    expect(rateText(recording)).toBe('–');
    expect(rateText({ ...recording, rates: [100, 99.96] })).toBe('100.0 of 100.0 Hz');
    const slowest = { motor: 'st0/motor1', rate: 87.24 };
    expect(rateText({ ...recording, rates: [100, 98.5], slowest })).toBe('lowest mean 87.2 of 100.0 Hz (st0/1); last second 98.5 Hz');
  });

  it('names the motors without values, and for how long', () => {
    const gaps = [
      { motor: 'rmd0/motor3', seconds: 1.2 }, { motor: 'st1/motor1', seconds: 87.4 }, { motor: 'st1/motor2', seconds: 88.2 },
    ];
    expect(gapsText(gaps)).toBe('st1/1, st1/2: 88 s without values; rmd0/3: 1.2 s without values');
    // A motor that never gave a value is not named twice.
    expect(missing({ ...recording, gaps, silent: ['rmd0/motor3'] })).toBe(
      'st1/1, st1/2: 88 s without values; no values of rmd0/3',
    );
  });
});
