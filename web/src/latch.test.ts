import { type Signal, signal } from '@preact/signals';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';

let latchedBy: Signal<string | null>;
let lines: Signal<object[]>;
let linesAt: Signal<number>;
let entries: Signal<object[]>;
let latch: typeof import('./latch');

beforeEach(async () => {
  vi.useFakeTimers({ toFake: ['setTimeout', 'clearTimeout'] });
  latchedBy = signal(null);
  lines = signal([{ line: 'st1' }]);
  linesAt = signal(0);
  entries = signal([]);
  const motors = signal(new Map([['st1', [1, 2]]]));
  vi.doMock('./link', () => ({ entries, latchedBy, lines, linesAt, motors }));
  vi.doMock('./stop', () => ({
    nameOf: (line: string, motor: number) => `${line}/${motor}`,
    inOrder: (names: Iterable<string>) => [...names].sort(),
    named: (names: string[]) => names.join(', '),
  }));
  vi.resetModules();
  latch = await import('./latch');
});

afterEach(() => {
  vi.useRealTimers();
});

const happened = (event: string, motor?: number) =>
  void (entries.value = [...entries.value, { number: entries.value.length + 1, event, line: 'st1', motor }]);
const text = () => latch.latchText.value;

/** Another page stops all motors. */
function pressed() {
  latchedBy.value = 'page 1';
  happened('latched');
  for (const motor of [1, 2, 7]) happened('stopping', motor);
}

describe('the latch', () => {
  it('says nothing without a latch', () => {
    happened('stop-failed', 1);
    expect(text()).toBeNull();
  });

  it('is a stop that was pressed until all motors have confirmed it', () => {
    latchedBy.value = 'page 1';
    happened('latched');
    expect(text()).toBe('Stop pressed by page 1.');
    for (const motor of [1, 2]) happened('stopping', motor);
    happened('stopped', 1);
    expect(text()).toBe('Stop pressed by page 1.');
    happened('stopped', 2);
    expect(text()).toBe('Stopped by page 1.');
  });

  it('names motors that have not confirmed after 1 s, but no address where no motor was found', () => {
    pressed();
    happened('stopped', 1);
    vi.advanceTimersByTime(1000);
    expect(text()).toBe('Stop of all by page 1. Not confirmed, may be turning: st1/2.');
    happened('stopped', 2);
    expect(text()).toBe('Stopped by page 1.');
  });

  it('names a motor whose stop failed at once', () => {
    pressed();
    happened('stopped', 1);
    happened('stop-failed', 2);
    expect(text()).toBe('Stop of all by page 1. Not confirmed, may be turning: st1/2.');
  });

  it('is no stop if a program only latched motion', () => {
    latchedBy.value = 'operator';
    happened('latched');
    vi.advanceTimersByTime(1000);
    expect(text()).toBe('Latched by operator, without a stop.');
  });

  it('may be without a stop for a page that was opened later', () => {
    latchedBy.value = 'operator';
    expect(text()).toBe('Latched by operator.');
    happened('commanded', 1);
    vi.advanceTimersByTime(1000);
    expect(text()).toBe('Latched by operator.');
  });

  it('is known to a page that was opened later from the lines', () => {
    latchedBy.value = 'page 1';
    lines.value = [{ line: 'st1', unstopped: [1, 2] }];
    expect(text()).toBe('Stop of all by page 1. Not confirmed, may be turning: st1/1, st1/2.');
    happened('stopped', 1);
    expect(text()).toBe('Stop of all by page 1. Not confirmed, may be turning: st1/2.');
    linesAt.value = 1;
    lines.value = [{ line: 'st1' }];
    expect(text()).toBe('Stopped by page 1.');
  });
});
