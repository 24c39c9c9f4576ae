import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { type Panel, Scheduler } from './scheduler';
import { Window } from './window';

let frames: FrameRequestCallback[] = [];
let clock = 0;

beforeEach(() => {
  frames = [];
  clock = 0;
  vi.useFakeTimers();
  vi.stubGlobal('requestAnimationFrame', (callback: FrameRequestCallback) => frames.push(callback));
  vi.stubGlobal('cancelAnimationFrame', () => (frames = []));
  vi.spyOn(performance, 'now').mockImplementation(() => clock);
});
afterEach(() => {
  vi.restoreAllMocks();
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

/** The browser draws. */
const frame = (after = 16) => {
  clock += after;
  const due = frames;
  frames = [];
  for (const callback of due) callback(clock);
};

const panel = (cost = 0) => {
  const one: Panel & { drawn: number; written: number } = {
    visible: true, drawn: 0, written: 0,
    draw: () => ((one.drawn += 1), (clock += cost)),
    write: () => (one.written += 1),
  };
  return one;
};

it('draws once a frame, however much comes', () => {
  const scheduler = new Scheduler(new Window(10, true, 1, 600), () => 1);
  const one = panel();
  scheduler.add(one);
  for (let count = 0; count < 100; count += 1) scheduler.sampled();
  expect(frames).toHaveLength(1);
  frame();
  expect(one.drawn).toBe(1);
});

it('does nothing without a change', () => {
  const scheduler = new Scheduler(new Window(10, false, 1, 600));
  const one = panel();
  scheduler.add(one);
  frame();
  vi.advanceTimersByTime(1000);
  for (let count = 0; count < 10; count += 1) frame();
  expect([one.drawn, frames.length, vi.getTimerCount()]).toEqual([1, 0, 0]);
});

it('hardly draws what is not on the screen, and not what stands still', () => {
  const window = new Window(10, true, 1, 600);
  const scheduler = new Scheduler(window, () => 1);
  const [seen, hidden] = [panel(), panel()];
  hidden.visible = false;
  scheduler.add(seen);
  scheduler.add(hidden);
  frame();
  for (let count = 0; count < 20; count += 1) {
    scheduler.sampled();
    frame();
  }
  expect([seen.drawn, hidden.drawn]).toEqual([21, 1]);
  window.pause();
  scheduler.sampled();
  const { written } = seen;
  frame(200);
  expect([seen.drawn, seen.written]).toEqual([21, written + 1]);
});

it('leaves the main thread time for other work', () => {
  const scheduler = new Scheduler(new Window(10, true, 1, 600), () => 1);
  const slow = panel(30);
  scheduler.add(slow);
  const start = clock;
  while (clock - start < 3000) {
    scheduler.sampled();
    frame();
  }
  expect((slow.drawn * 30) / (clock - start)).toBeLessThan(0.25);
  expect(slow.drawn).toBeGreaterThan(10);
});

it('lets live values become old without new ones, and ends with the last plot', () => {
  const scheduler = new Scheduler(new Window(10, true, 1, 600), () => 1);
  const one = panel();
  const remove = scheduler.add(one);
  frame();
  vi.advanceTimersByTime(300);
  frame(300);
  expect(one.drawn).toBe(2);
  remove();
  vi.advanceTimersByTime(1000);
  scheduler.sampled();
  expect(frames).toHaveLength(0);
  expect(vi.getTimerCount()).toBe(0);
});

it('moves in few steps for those who do not want motion, and obeys the user at once', () => {
  const scheduler = new Scheduler(new Window(10, true, 1, 600), () => 1, () => true);
  const one = panel();
  scheduler.add(one);
  frame();
  for (let count = 0; count < 60; count += 1) {
    scheduler.sampled();
    frame();
  }
  expect(one.drawn).toBe(2);
  expect(one.written).toBeGreaterThan(10);
  scheduler.request();
  frame();
  expect(one.drawn).toBe(3);
});
