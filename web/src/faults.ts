// The faults of all motors, for the header of every view.
import { signal } from '@preact/signals';
import { type MotorId, allMotors, descriptions } from './drives';
import { nameOf } from './format';
import { type Rows, age, wallAt } from './link';
import { named } from './stop';
import { follow } from './subscriptions';
import type { Fault, SignalName } from './wire';

/** How often the faults of all motors are read while no other view reads them, in seconds. */
const PERIOD = 0.5;
/** A value that is older, in seconds, is marked in the header. */
const OLD = 3;
/** How often the ages of the values are looked at, in ms. */
const LOOK = 500;

/** Whether a bit of a value is set. Bits above 31 are beyond the operators of numbers. */
const has = (value: number, bit: number) => Math.floor(value / 2 ** bit) % 2 === 1;

/** What to say about the bits of a value. */
export function told(value: number, faults: readonly Fault[]) {
  const set = faults.filter(({ bit }) => has(value, bit));
  const names = new Set(set.filter(({ present }) => present).map(({ name }) => name));
  return {
    // A fault whose cause is present is not told a second time as one that occurred.
    shown: set.filter(({ present, name }) => present || !names.has(name)),
    unknown: value - set.reduce((sum, { bit }) => sum + 2 ** bit, 0),
  };
}

/** How many faults a value has. Unknown ones are one. */
export function countOf(value: number, faults: readonly Fault[]): number {
  const { shown, unknown } = told(value, faults);
  return shown.length + (unknown ? 1 : 0);
}

/** A number of faults in words. */
export const faultsText = (count: number) => `${count || 'no'} ${count === 1 ? 'fault' : 'faults'}`;

/** The last value of the faults of each motor, by name. */
const last = new Map<string, { value: number; wall: number }>();

/** How many faults a motor had last. 0 if that is not known. */
function faultsAt(line: string, motor: number): number {
  const known = last.get(nameOf(line, motor));
  return known ? countOf(known.value, descriptions.peek().get(line)?.faults ?? []) : 0;
}

/** How many of these motors have a fault. */
export const faulty = (motors: readonly MotorId[]) =>
  motors.filter(({ line, motor }) => faultsAt(line, motor) > 0).length;

/** The faults of all motors in words. Empty if there is none. */
export const faultSummary = signal('');

function summary(): string {
  let count = 0;
  const names: string[] = [];
  for (const { line, motor } of allMotors.peek()) {
    const name = nameOf(line, motor);
    const faults = faultsAt(line, motor);
    if (!faults) continue;
    count += faults;
    // NaN: the age is unknown.
    names.push(age(last.get(name)?.wall ?? NaN) <= OLD ? name : `${name} (old)`);
  }
  return count ? `${faultsText(count)}: ${named(names)}` : '';
}

function take({ line, motor, t0, t, values }: Rows) {
  const row = t.length - 1;
  const value = values[0]?.[row];
  if (value === undefined || Number.isNaN(value)) return;
  last.set(nameOf(line, motor), { value, wall: wallAt(line, t0 + t[row]!) });
  faultSummary.value = summary();
}

/** Reads the faults of all motors while the page is visible. Returns what ends it. */
export function watchFaults(): () => void {
  const isHidden = signal(document.hidden);
  const look = () => void (isHidden.value = document.hidden);
  document.addEventListener('visibilitychange', look);
  const stopReading = follow(() => {
    const signals = allMotors.value.flatMap(({ line, motor }): SignalName[] => {
      const name = descriptions.value.get(line)?.overview.faults;
      return name === undefined ? [] : [{ line, motor, name }];
    });
    return isHidden.value ? [] : [{ signals, period: PERIOD }];
  }, take);
  const timer = setInterval(() => (faultSummary.value = summary()), LOOK);
  return () => {
    stopReading();
    clearInterval(timer);
    document.removeEventListener('visibilitychange', look);
  };
}
