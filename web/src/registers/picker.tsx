import { effect } from '@preact/signals';
import { useEffect, useState } from 'preact/hooks';
import { allMotors, describeLines, descriptions } from '../drives';
import { nameOf } from '../format';
import { lines, welcome } from '../link';
import './picker.css';
import { chosen } from './values';

/** Chooses the motor of the views of registers, settings and steps. */
export function MotorPicker({ disabled = false }: { disabled?: boolean }) {
  const motors = allMotors.value;
  const [failure, setFailure] = useState<string | null>(null);
  useEffect(
    () =>
      effect(() => {
        if (welcome.value && lines.value.length) void describeLines().then(setFailure);
      }),
    [],
  );
  useEffect(
    () =>
      effect(() => {
        if (!chosen.value && allMotors.value[0]) chosen.value = allMotors.value[0];
      }),
    [],
  );
  const names = motors.map(({ line, motor }) => nameOf(line, motor));
  const now = chosen.value && nameOf(chosen.value.line, chosen.value.motor);
  return (
    <>
      <label class="labelled">
        <span>Motor</span>
        <select
          value={now ?? ''}
          disabled={disabled || !names.length}
          onChange={({ currentTarget }) => {
            chosen.value = motors[names.indexOf(currentTarget.value)] ?? null;
          }}
        >
          {!names.length && <option value="">none found</option>}
          {now && !names.includes(now) && <option value={now}>{now} (not found now)</option>}
          {names.map((name) => (
            <option key={name} value={name}>
              {name}
            </option>
          ))}
        </select>
      </label>
      {failure && chosen.value && !descriptions.value.has(chosen.value.line) && (
        <p class="note bad">The registers are not known: {failure}</p>
      )}
    </>
  );
}
