import { signal } from '@preact/signals';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { SignalName } from './wire';

const speed = (line: string, motor: number): SignalName => ({ line, motor, name: 'speed' });

describe('subscriptions', () => {
  let follow: typeof import('./subscriptions').follow;
  const running = new Map<number, string[]>();
  const subscribe = vi.fn();

  beforeEach(async () => {
    vi.useFakeTimers();
    running.clear();
    let last = 0;
    subscribe.mockReset().mockImplementation((signals: SignalName[]) => {
      last += 1;
      const number = last;
      running.set(number, signals.map(({ line, motor }) => `${line}/${motor}`));
      return () => running.delete(number);
    });
    vi.doMock('./link', () => ({ subscribe }));
    vi.resetModules();
    ({ follow } = await import('./subscriptions'));
  });

  afterEach(() => {
    vi.useRealTimers();
  });

  it('stay at a node when another one changes', () => {
    const wanted = signal([speed('arm1/st0', 1), speed('arm2/st0', 1)]);
    const end = follow(() => [{ signals: wanted.value, period: 0.1 }], () => {});
    expect([...running.values()]).toEqual([['arm1/st0/1'], ['arm2/st0/1']]);
    wanted.value = [...wanted.value, speed('arm2/st0', 2)];
    vi.runAllTimers();
    expect([...running]).toEqual([
      [1, ['arm1/st0/1']],
      [3, ['arm2/st0/1', 'arm2/st0/2']],
    ]);
    end();
    expect(running.size).toBe(0);
  });

  it('change once when many motors come', () => {
    const wanted = signal([speed('st0', 1)]);
    const end = follow(() => [{ signals: wanted.value, period: 0.1 }], () => {});
    for (let motor = 2; motor <= 20; motor += 1) wanted.value = [...wanted.value, speed('st0', motor)];
    vi.runAllTimers();
    expect(subscribe).toHaveBeenCalledTimes(2);
    expect([...running.values()][0]).toHaveLength(20);
    end();
  });

  it('end at once when nothing is wanted', () => {
    const wanted = signal([speed('st0', 1)]);
    const end = follow(() => [{ signals: wanted.value, period: 0.1 }], () => {});
    wanted.value = [];
    expect(running.size).toBe(0);
    end();
  });
});
