// Who did what when.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { allMotors } from '../drives';
import { nameOf, timeOfDay } from '../format';
import { entries } from '../link';
import type { EventKind } from '../wire';
import './events.css';

const SHOWN = 200;
/** Time between drawings, ms. */
const DRAW = 200;
const BAD: ReadonlySet<EventKind> = new Set(['stop-failed', 'lost', 'silent', 'doubtful', 'refused']);
const STOPS: ReadonlySet<EventKind> = new Set(['stopping', 'latched']);

const toneOf = (event: EventKind) => (BAD.has(event) ? 'bad' : STOPS.has(event) ? 'warn' : 'muted');

export default function Events() {
  const wanted = useSignal('');
  const most = useSignal(SHOWN);
  const motors = allMotors.value.map(({ line, motor }) => nameOf(line, motor));
  // A ramp is many events.
  const shown = useSignal(entries.peek());
  useEffect(() => {
    const timer = setInterval(() => (shown.value = entries.peek()), DRAW);
    return () => clearInterval(timer);
  }, []);
  const all = shown.value;
  const chosen = all
    .filter(({ line, motor }) => wanted.value === '' || (line && motor != null && nameOf(line, motor) === wanted.value))
    .reverse();
  return (
    <>
      <div class="bar">
        <h2>Events</h2>
        <label>
          Motor{' '}
          <select value={wanted.value} onChange={({ currentTarget }) => (wanted.value = currentTarget.value)}>
            <option value="">all</option>
            {motors.map((name) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        </label>
      </div>
      <p class="muted">
        <q>page 1</q> is a page in a browser. A page opens a second connection, <q>(control)</q>, when it commands
        motors. <q>joined</q>: a program or page was connected. <q>left</q>: it was disconnected.
      </p>
      {chosen.length === 0 && <p class="muted">Nothing happened since this page was opened.</p>}
      {chosen.length > 0 && (
        <table class="events">
          <caption class="hidden">Events, the newest first</caption>
          <thead>
            <tr>
              <th scope="col">Time</th>
              <th scope="col">Motor</th>
              <th scope="col">By</th>
              <th scope="col">Kind</th>
              <th scope="col">What</th>
            </tr>
          </thead>
          <tbody>
            {chosen.slice(0, most.value).map(({ number, wall, line, motor, by, event, message, times }) => (
              <tr key={number}>
                <td class="mono">{timeOfDay(wall)}</td>
                <td>{line ? (motor == null ? line : nameOf(line, motor)) : ''}</td>
                <td>{by}</td>
                <td>
                  <span class={toneOf(event)}>{event}</span>
                </td>
                <td>
                  {message}
                  {times > 1 && <span class="muted"> (the last of {times})</span>}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
      {chosen.length > most.value && (
        <button type="button" onClick={() => (most.value += SHOWN)}>
          Show {Math.min(SHOWN, chosen.length - most.value)} more of {chosen.length}
        </button>
      )}
    </>
  );
}
