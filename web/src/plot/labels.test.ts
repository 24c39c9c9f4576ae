import { expect, test } from 'vitest';
import { labelsOf } from './labels';

/** Ten pixels for each character. */
const width = (text: string) => 10 * text.length;
const of = (marks: readonly (readonly [x: number, label: string])[], right = 1000) =>
  labelsOf(marks.map(([x, label]) => ({ x, label })), width, right, 4).map(({ x, text, isLeft }) => `${x} ${text}${isLeft ? ' left' : ''}`);

test('marks that are far from each other have their own texts', () => {
  expect(of([[500, 'stopped'], [10, 'lost']])).toEqual(['10 lost', '500 stopped']);
  expect(of([])).toEqual([]);
});

test('the texts of near marks become one with their number', () => {
  expect(of([[10, 'lost'], [20, 'lost'], [30, 'back'], [500, 'stopped']])).toEqual(['10 3 events', '500 stopped']);
  // The text of two marks is longer than that of the first: the third one is near to it, too.
  expect(of([[10, 'a'], [12, 'b'], [60, 'c']])).toEqual(['10 3 events']);
});

test('texts at the right edge are left of their marks, and over no other', () => {
  expect(of([[900, 'a'], [990, 'stopped']])).toEqual(['900 2 events']);
  expect(of([[500, 'a'], [990, 'stopped']])).toEqual(['500 a', '990 stopped left']);
});

test('no two texts lie over each other', () => {
  const marks = Array.from({ length: 200 }, (_, n) => ({ x: (n * 7919) % 1000, label: 'commanded st0/motor1'.slice(0, 1 + (n % 20)) }));
  for (let take = 1; take < marks.length; take += 1) {
    const placed = labelsOf(marks.slice(0, take), width, 1000, 4);
    const spans = placed.map(({ x, text, isLeft }) => (isLeft ? [x - 4 - width(text), x] : [x, x + 4 + width(text)]) as [number, number]);
    spans.slice(1).forEach(([from], at) => expect(from).toBeGreaterThanOrEqual(spans[at]![1]));
  }
});
