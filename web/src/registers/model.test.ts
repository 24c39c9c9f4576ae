import { describe, expect, it } from 'vitest';
import type { Register } from '../wire';
import { access, found, groups, isSame, numberOf, rangeText } from './model';

const register = (name: string, more: Partial<Register> = {}): Register => ({
  name, group: 'any drive', doc: '', unit: '', readable: true, writable: true, wears_rom: false, can_keep: false, range: null, ...more,
});

describe('search', () => {
  const registers = [
    register('SPEED_KP', { doc: 'Speed regulator Kp, numerator', unit: 's16A/unit' }),
    register('SPEED_MEAS', { doc: 'Mechanical speed, averaged', unit: 'rpm' }),
    register('PFC_I_KP', { doc: 'PFC current regulator Kp', group: 'power factor correction' }),
  ];
  it.each([
    ['', 3], ['kp', 2], ['speed kp', 1], ['RPM', 1], ['power factor', 1], ['  averaged ', 1], ['nothing', 0],
  ])('for `%s` finds %d', (search, count) => expect(found(registers, search)).toHaveLength(count));

  it('keeps groups together, in the order of the table', () => {
    const mixed = [registers[0]!, registers[2]!, registers[1]!];
    expect(groups(mixed).map(({ group, registers: of }) => [group, of.length])).toEqual([
      ['any drive', 2],
      ['power factor correction', 1],
    ]);
  });
});

describe('a value to write', () => {
  const gain = { range: [-32768, 32767, 1] as const, unit: 'A' };
  it.each([['12', 12], [' -7 ', -7], ['−7', -7], ['1e3', 1000], ['+5', 5], ['3.0', 3]])(
    '`%s` is %d', (text, value) => expect(numberOf(text, gain)).toEqual({ value }),
  );
  it.each([
    ['', /number/], ['12a', /not a number/], ['1,5', /point/], ['0x10', /not a number/], ['NaN', /not a number/],
    ['Infinity', /not a number/], ['32768', /-32768 to 32767 A/], ['1e400', /Out of range/], ['1.5', /1 or 2/],
  ])('`%s` is refused before it is sent', (text, why) =>
    expect(numberOf(text, gain)).toEqual({ why: expect.stringMatching(why) }),
  );
  it('may have decimals where the step has', () => {
    const speed = { range: [-600, 600, 0.01] as const, unit: '°/s' };
    expect(numberOf('0.07', speed)).toEqual({ value: 0.07 });
    expect(numberOf('-599.99', speed)).toEqual({ value: -599.99 });
    expect(numberOf('0.075', speed)).toEqual({ why: 'The step is 0.01: 0.07 or 0.08.' });
  });
  it('has no range where the register gives none', () => {
    expect(numberOf('0.125', { range: null, unit: '' })).toEqual({ value: 0.125 });
  });
  it('is compared with what is read back', () => {
    expect(isSame(250, 250, 1)).toBe(true);
    expect(isSame(250, 249, 1)).toBe(false);
    expect(isSame(0.1, 0.10000000149, 0)).toBe(true);
  });
});

it('says range and access in words', () => {
  expect(rangeText([0, 255, 1])).toBe('0 to 255');
  expect(rangeText([-600, 600, 0.01], '°/s')).toBe('-600 to 600 °/s, step 0.01');
  expect(rangeText(null)).toBe('');
  expect(access(register('A', { writable: false }))).toBe('read');
  expect(access(register('A', { readable: false }))).toBe('write');
});
