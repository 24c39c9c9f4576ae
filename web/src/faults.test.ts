import { signal } from '@preact/signals';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { Rows } from './link';
import type { Fault } from './wire';

const FAULTS: Fault[] = [
  { bit: 1, name: 'OVER_VOLT', doc: '', advice: '', present: true },
  { bit: 17, name: 'OVER_VOLT', doc: '', advice: '', present: false },
  { bit: 18, name: 'UNDER_VOLT', doc: '', advice: '', present: false },
];
const PRESENT = 2 + 2 ** 17;

describe('faults', () => {
  let faults: typeof import('./faults');
  let take: (rows: Rows) => void;
  let hidden: boolean;
  let look: () => void;
  let now: number;
  const subscribe = vi.fn();
  const ended = vi.fn();

  beforeEach(async () => {
    vi.useFakeTimers({ toFake: ['setInterval', 'clearInterval'] });
    subscribe.mockReset().mockImplementation((_signals, _period, onRows: typeof take) => {
      take = onRows;
      return ended;
    });
    ended.mockReset();
    hidden = false;
    now = 0;
    vi.stubGlobal('document', {
      get hidden() {
        return hidden;
      },
      addEventListener: (_: string, listener: () => void) => (look = listener),
      removeEventListener: () => {},
    });
    vi.doMock('./link', () => ({ age: (wall: number) => now - wall, subscribe, wallAt: (_: string, t: number) => t }));
    vi.doMock('./drives', () => ({
      allMotors: signal([1, 2, 3].map((motor) => ({ line: 'st0', motor }))),
      descriptions: signal(new Map([['st0', { faults: FAULTS, overview: { faults: 'FLAGS' } }]])),
    }));
    vi.doMock('./stop', () => ({
      nameOf: (line: string, motor: number) => `${line}/${motor}`,
      named: (names: string[]) => names.join(', '),
    }));
    vi.resetModules();
    faults = await import('./faults');
  });

  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  const give = (motor: number, value: number) =>
    take({ line: 'st0', motor, columns: [{ name: 'FLAGS', unit: '' }], t0: now, t: [0], values: [[value]], lost: 0 } as unknown as Rows);

  it('are counted, and those whose cause is present only once', () => {
    expect(faults.countOf(PRESENT, FAULTS)).toBe(1);
    expect(faults.countOf(PRESENT + 2 ** 18 + 2 ** 5, FAULTS)).toBe(3);
    expect([0, 1, 2].map(faults.faultsText)).toEqual(['no faults', '1 fault', '2 faults']);
  });

  it('of all motors are read twice a second, and named', () => {
    const end = faults.watchFaults();
    expect(subscribe.mock.calls[0]!.slice(0, 2)).toEqual([[1, 2, 3].map((motor) => ({ line: 'st0', motor, name: 'FLAGS' })), 0.5]);
    give(1, 0);
    expect(faults.faultSummary.value).toBe('');
    give(1, PRESENT);
    expect(faults.faultSummary.value).toBe('1 fault: st0/1');
    give(3, 2 ** 18);
    expect(faults.faultSummary.value).toBe('2 faults: st0/1, st0/3');
    now = 5;
    give(3, 0);
    expect(faults.faultSummary.value).toBe('1 fault: st0/1 (old)');
    give(1, 0);
    expect(faults.faultSummary.value).toBe('');
    end();
    expect(ended).toHaveBeenCalledOnce();
  });

  it('are not read while the page is hidden', () => {
    const end = faults.watchFaults();
    hidden = true;
    look();
    expect(ended).toHaveBeenCalledOnce();
    hidden = false;
    look();
    expect(subscribe).toHaveBeenCalledTimes(2);
    end();
  });
});
