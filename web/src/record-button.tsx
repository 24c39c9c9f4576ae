// The recording in the header of each view.
import { duration } from './format';
import { ask, recorded, welcome } from './link';
import { Said, useSaid } from './parts';
import { elapsed, size } from './recordings/part';
import type { Gap, Recorded } from './wire';
import './record-button.css';

/** Whether something is recorded. */
export const isActive = (recording: Recorded | null): boolean =>
  recording !== null && ['starting', 'recording', 'ending'].includes(recording.phase);

/** The name of a motor as the other views write it. */
const short = (motor: string) => motor.replace('/motor', '/');

/** Times that differ by less than this, in seconds or as a part of the longer one, are of one cause. */
const SAME = { seconds: 0.5, part: 0.05 };

/** Motors without values for a time, in words; those with about the same time together. Empty without any. */
export function gapsText(gaps: readonly Gap[]): string {
  const groups: { longest: number; motors: string[] }[] = [];
  for (const { motor, seconds } of gaps.toSorted((one, other) => other.seconds - one.seconds)) {
    const last = groups.at(-1);
    if (last && last.longest - seconds < Math.max(SAME.seconds, SAME.part * last.longest)) last.motors.push(motor);
    else groups.push({ longest: seconds, motors: [motor] });
  }
  return groups
    .map(({ longest, motors }) => {
      const time = duration(longest < 10 ? longest : Math.round(longest));
      return `${motors.map(short).toSorted().join(', ')}: ${time} without values`;
    })
    .join('; ');
}

/** What is missing in a recording, in words; empty if nothing is. */
export function missing({ lost, unconfirmed, silent, gaps, left_out }: Recorded): string {
  return [
    gapsText(gaps.filter(({ motor }) => !silent.includes(motor))),
    lost > 0 && `${lost} lost`,
    unconfirmed > 0 && `${unconfirmed} rows not confirmed`,
    silent.length > 0 && `no values of ${silent.map(short).join(', ')}`,
    left_out.length > 0 && `no motor answered on ${left_out.join(', ')}`,
  ]
    .filter(Boolean)
    .join('; ');
}

/** The rate of the slowest motor: the mean since the start, with its name, and that of the last second. */
export function rateText({ rates, slowest }: Recorded): string {
  if (!rates) return '–';
  const [asked, now] = rates.map((rate) => rate.toFixed(1));
  if (!slowest) return `${now} of ${asked} Hz`;
  const mean = Math.min(slowest.rate, rates[0]).toFixed(1);
  return `lowest mean ${mean} of ${asked} Hz (${short(slowest.motor)}); last second ${now} Hz`;
}

/** The recording as a short text. */
export function summary(recording: Recorded): string {
  switch (recording.phase) {
    case 'starting':
      return 'REC starts: reads the settings of the motors';
    case 'ending':
      return 'REC ends';
    default:
      return `REC ${elapsed(recording.seconds)} ${size(recording.bytes)}`;
  }
}

/** Begins and ends a recording, and says how far it is. */
export function RecordButton({ rate = null }: { rate?: number | null }) {
  const { said, attempt, isBusy } = useSaid();
  const recording = recorded.value;
  const who = welcome.value;
  if (!who) return null;
  const isOn = isActive(recording);
  const active = isOn ? recording : null;
  const lacks = active ? missing(active) : '';
  const press = () =>
    attempt(async () => {
      if (isOn) await ask({ ask: 'end-recording' });
      else await ask({ ask: 'record', rate });
    });
  return (
    <span class="record" role="group" aria-label="Recording">
      {who.role === 'operator' && (
        // A recording that starts can be ended, too.
        <button type="button" disabled={recording?.phase === 'ending' || (isBusy && !isOn)} onClick={press}>
          {isOn ? '■ End recording' : '● Record'}
        </button>
      )}
      {active && <span class="record-state">{summary(active)}</span>}
      {lacks && <strong class="bad">! {lacks}</strong>}
      {!isOn && recording?.phase === 'failed' && !said && (
        <span class="bad">! The recording failed: {recording.message}</span>
      )}
      <Said said={said} />
    </span>
  );
}
