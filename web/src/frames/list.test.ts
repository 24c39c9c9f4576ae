import { expect, test } from 'vitest';
import type { WireFrame, WireLoad } from '../wire';
import { NO_FILTER, addressOf, asCsv, asText, countsOf, filtered, joined, nearest, sum, told, troubleOf, wanted, windowOf } from './list';

const frame = (number: number, more: Partial<WireFrame> = {}): WireFrame => ({
  number, t: number / 10, direction: 'to-drive', result: 'ok', bytes: '22 01 1e 41',
  words: 'GET_REG SPEED_MEAS, motor 1', motor: 1, retry: false, unanswered: false, ...more,
});
const load = (more: Partial<WireLoad> = {}): WireLoad => ({
  bits: 0, busy: 0, nacks: 0, damaged: 0, retries: 0, unanswered: 0, ...more,
});

test('an address names a line and an instant', () => {
  expect(wanted('#/wire')).toEqual({ line: null, t: null });
  expect(wanted('#/wire?line=st0&t=12.345')).toEqual({ line: 'st0', t: 12.345 });
  expect(wanted('#/wire?line=st0&t=soon')).toEqual({ line: 'st0', t: null });
  expect(wanted('#/wire?line=st0&t=')).toEqual({ line: 'st0', t: null });
  expect(wanted(addressOf('rmd0', 0.5))).toEqual({ line: 'rmd0', t: 0.5 });
  expect(wanted(addressOf('rmd0'))).toEqual({ line: 'rmd0', t: null });
});

test('only a window of the rows is in the document', () => {
  expect(windowOf(0, 0, 300, 30)).toEqual({ first: 0, end: 0 });
  expect(windowOf(5, 0, 300, 30)).toEqual({ first: 0, end: 5 });
  expect(windowOf(20_000, 3000, 300, 30, 2)).toEqual({ first: 98, end: 113 });
  // The end, and a place behind it after a filter.
  expect(windowOf(100, 2700, 300, 30, 2)).toEqual({ first: 88, end: 100 });
  expect(windowOf(100, 99_999, 300, 30, 2)).toEqual({ first: 88, end: 100 });
});

test('a filter looks at words, bytes, directions and errors', () => {
  const frames = [
    frame(1), frame(2, { direction: 'from-drive', result: 'nack', words: 'NACK WRONG_CMD', bytes: 'ff 01 07 08' }),
    frame(3, { retry: true }), frame(4, { unanswered: true }), frame(5, { result: 'damaged', words: 'stray' }),
    frame(6, { result: 'foreign' }),
  ];
  const numbers = (filter: object) => filtered(frames, { ...NO_FILTER, ...filter }).map(({ number }) => number);
  expect(filtered(frames, NO_FILTER)).toBe(frames);
  expect(numbers({ text: 'wrong nack' })).toEqual([2]);
  expect(numbers({ text: '01 07' })).toEqual([2]);
  expect(numbers({ text: 'No Reply' })).toEqual([4]);
  expect(numbers({ direction: 'from-drive' })).toEqual([2]);
  expect(numbers({ onlyErrors: true })).toEqual([2, 3, 4, 5]);
  expect(numbers({ onlyErrors: true, text: 'speed' })).toEqual([3, 4]);
});

test('the oldest frames are dropped', () => {
  const frames = joined([frame(1), frame(2)], [frame(3)], 2);
  expect(frames.map(({ number }) => number)).toEqual([2, 3]);
  expect(joined(frames, [])).toBe(frames);
});

test('the nearest frame is marked', () => {
  expect(nearest([], 1)).toBe(-1);
  expect(nearest([frame(1), frame(2), frame(3)], 0.21)).toBe(1);
});

test('troubles are words', () => {
  expect(troubleOf(frame(1))).toBe('');
  expect(troubleOf(frame(1, { retry: true, unanswered: true }))).toBe('retry, no reply');
  expect(troubleOf(frame(1, { result: 'nack' }))).toBe('NACK');
});

test('loads are added', () => {
  expect(told(sum([]))).toBe('No frames.');
  const all = sum([
    load({ from: 1, to: 2, bits: 1000, busy: 1, nacks: 1 }), load(),
    load({ from: 2, to: 5, bits: 3000, busy: 0, retries: 2, damaged: 1 }),
  ]);
  expect(all).toEqual(load({ from: 1, to: 5, bits: 4000, busy: 0.25, nacks: 1, retries: 2, damaged: 1 }));
  expect(told(all)).toBe('In 4.0 s: 25 % of the time waiting for replies, 1.0 kbit/s.');
  expect(told(all, true)).toMatch(/^In the last 4.0 s: /);
  expect(told({ ...all, busy: 0.004 })).toContain('less than 1 % of the time');
});

test('errors are counted in the frames that are listed', () => {
  const frames = [
    frame(1, { unanswered: true }), frame(2, { retry: true, unanswered: true }), frame(3, { result: 'nack' }), frame(4),
    frame(5, { result: 'damaged' }),
  ];
  expect(countsOf(frames)).toBe('5 frames are listed: 1 refused (NACK), 1 retry, 2 without a reply, 1 damaged.');
  expect(countsOf([frame(4)])).toBe('1 frame is listed: 0 refused (NACK), 0 retries, 0 without a reply, 0 damaged.');
});

test('frames are exported as text and as values', () => {
  const frames = [frame(10), frame(11, { id: 0x141, bytes: '9a', words: 'a "b"', unanswered: true, motor: null })];
  expect(asText(frames)).toBe(
    '1.000000 -> 22 01 1e 41                      GET_REG SPEED_MEAS, motor 1\n' +
      '1.100000 -> 141 # 9a                         a "b" (no reply)\n',
  );
  expect(asCsv(frames)).toBe(
    't,direction,motor,result,retry,unanswered,id,bytes,words\r\n' +
      '1.000000,to-drive,1,ok,false,false,,22 01 1e 41,"GET_REG SPEED_MEAS, motor 1"\r\n' +
      '1.100000,to-drive,,ok,false,true,321,9a,"a ""b"""\r\n',
  );
});
