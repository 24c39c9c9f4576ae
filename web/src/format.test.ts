import { describe, expect, it } from 'vitest';
import { decimalsOfStep, duration, number, rate, sentence, tooOld } from './format';

describe('numbers', () => {
  it('have fixed decimals, a real minus, no negative zero, and a dash without a value', () => {
    expect(number(12.345, 1)).toBe('12.3');
    expect(number(-12.345, 0)).toBe('−12');
    expect(number(-0.004, 2)).toBe('0.00');
    expect(number(NaN, 2)).toBe('–');
  });

  it('have the decimals of their step', () => {
    expect([1, 0.1, 0.01, 0.016, 5, 0.001].map(decimalsOfStep)).toEqual([0, 1, 2, 2, 0, 3]);
  });

  it('of rates are about as wide as each other', () => {
    expect([9.9, 9.97, 100, NaN].map(rate)).toEqual(['9.9/s', '\u200710/s', '100/s', '–']);
  });
});

describe('ages', () => {
  it('are told from 1 s on, or when they are unknown', () => {
    expect([0.9, -0.1, 1.04, 3, 59.9, 150, 9000].map(tooOld)).toEqual([
      null, null, '1.0 s old', '3.0 s old', '59 s old', '2 min old', '2 h old',
    ]);
    expect(tooOld(NaN)).toBe('age unknown');
    expect(duration(119)).toBe('119 s');
  });
});

it('texts of tables become sentences', () => {
  expect(['bus voltage too high', 'Done.', ''].map(sentence)).toEqual(['Bus voltage too high.', 'Done.', '']);
});
