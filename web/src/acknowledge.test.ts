import { signal } from '@preact/signals';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';

vi.mock('./drives', () => ({
  descriptions: signal(new Map([['st0', {
    overview: { faults: 'FLAGS' },
    faults: [
      { bit: 1, name: 'OVER_VOLT', present: true },
      { bit: 2, name: 'OVER_TEMP', present: true },
      { bit: 17, name: 'OVER_VOLT', present: false },
    ],
  }]])),
}));
vi.mock('./stop', () => ({}));
vi.mock('./link', () => ({ age: (wall: number) => performance.now() / 1000 - wall }));
const values = new Map<string, { value: number; wall: number }>();
vi.mock('./overview', () => ({ liveOf: () => ({ values }) }));
const { afterAcknowledge } = await import('./acknowledge');

describe('after an acknowledge', () => {
  beforeEach(() => {
    vi.useFakeTimers({ toFake: ['setTimeout', 'performance'] });
    values.clear();
  });
  afterEach(() => void vi.useRealTimers());

  const after = async (value: number | null) => {
    // This was read before it.
    values.set('FLAGS', { value: 2 + 2 ** 17, wall: performance.now() / 1000 - 0.01 });
    const said = afterAcknowledge('st0', 1);
    await vi.advanceTimersByTimeAsync(200);
    if (value !== null) values.set('FLAGS', { value, wall: performance.now() / 1000 - 0.02 });
    await vi.advanceTimersByTimeAsync(5000);
    return said;
  };

  it('the next value says whether a cause is still present', async () => {
    expect(await after(0)).toEqual({ tone: 'ok', text: 'Faults acknowledged.' });
    expect(await after(2)).toEqual({ tone: 'bad', text: 'Acknowledged, but OVER_VOLT is still present.' });
    expect(await after(6 + 2 ** 17)).toMatchObject({ text: 'Acknowledged, but OVER_VOLT, OVER_TEMP are still present.' });
  });

  it('it is said if there is no next value', async () => {
    expect(await after(null)).toMatchObject({ tone: 'note', text: expect.stringContaining('could not be read') });
  });
});
