// The recording in the header of each view.
import { ask, recorded, welcome } from './link';
import { Said, useSaid } from './parts';
import { elapsed, size } from './recordings/part';
import type { Recorded } from './wire';
import './record-button.css';

/** Whether something is recorded. */
export const isActive = (recording: Recorded | null): boolean =>
  recording !== null && ['starting', 'recording', 'ending'].includes(recording.phase);

/** What is missing in a recording, in words; empty if nothing is. */
export function missing({ lost, unconfirmed, silent, left_out }: Recorded): string {
  return [
    lost > 0 && `${lost} lost`,
    unconfirmed > 0 && `${unconfirmed} rows not confirmed`,
    silent.length > 0 && `no values of ${silent.join(', ')}`,
    left_out.length > 0 && `no motor answered on ${left_out.join(', ')}`,
  ]
    .filter(Boolean)
    .join(', ');
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
