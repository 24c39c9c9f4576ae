// A card a motor: what it does, and the controls that move it.
import { useEffect, useRef } from 'preact/hooks';
import { allMotors, describeFailed, descriptions, isSearched, isSilent, motorEvents, shownMotors, watchDescriptions, watchLimits, watchRates } from '../drives';
import { nameOf } from '../format';
import { found, lines, refreshMotors, searchFailed, searching, welcome } from '../link';
import { liveOf, overviewRefused, watchOverview, watchView } from '../overview';
import { Said } from '../parts';
import { Control } from './control';
import './motors.css';
import { Nodes } from './nodes';
import { Values } from './values';
import { Words } from '../words';

const MOTOR_WORDS = ['line', 'latch', 's16A', 'ROM'] as const;

function Search() {
  const isBusy = searching.value.size > 0;
  const search = () => lines.value.forEach(({ line }) => void refreshMotors(line));
  return (
    <button type="button" disabled={isBusy || !welcome.value} onClick={search}>
      {isBusy ? 'Searching …' : 'Search motors'}
    </button>
  );
}

interface SilentProps {
  line: string;
  motor: number;
  /** The signal that is read most. */
  speed: string | undefined;
}

function Silent({ line, motor, speed }: SilentProps) {
  const live = liveOf(line, motor);
  // Drawn again with each tick.
  void live.tick.value;
  const isTold = motorEvents.value.has(nameOf(line, motor));
  const isHeard = !isTold && speed !== undefined && live.isHeard(speed);
  const isMissing = isSilent(line, motor) || (!isTold && !found.value.get(line)?.includes(motor));
  return isMissing && !isHeard ? <span class="chip bad">✕ silent</span> : null;
}

function Card({ line, motor }: { line: string; motor: number }) {
  const description = descriptions.value.get(line);
  const name = nameOf(line, motor);
  const card = useRef<HTMLElement>(null);
  useEffect(() => watchView(card.current!, liveOf(line, motor)), [line, motor]);
  return (
    <li>
      <article ref={card} class="card" aria-label={`Motor ${name}`}>
        <header>
          <h3>{name}</h3>
          {description && <span class="muted">{description.protocol.toUpperCase()}</span>}
          <Silent line={line} motor={motor} speed={description?.overview.speed} />
        </header>
        {description ? (
          <>
            <Values line={line} motor={motor} description={description} />
            <Control line={line} motor={motor} description={description} />
          </>
        ) : (
          <p class="muted">Waiting for the description of the drive …</p>
        )}
      </article>
    </li>
  );
}

/** Why it is not known yet which motors there are. */
function searchText(): string {
  if (welcome.value === null) return 'Connecting to the server …';
  return searching.value.size || lines.value.length ? 'Searching motors …' : 'Waiting for the lines of the server …';
}

export default function Motors() {
  useEffect(watchDescriptions, []);
  useEffect(watchOverview, []);
  useEffect(() => watchRates(), []);
  useEffect(() => watchLimits(), []);

  const all = allMotors.value;
  return (
    <>
      <div class="bar">
        <h2>Motors</h2>
        <Search />
      </div>
      {welcome.value?.role === 'viewer' && (
        <p class="note" id="viewer">
          <span>You are a viewer: you see everything and can stop. Motion and settings need the operator's address.</span>
        </p>
      )}
      {describeFailed.value !== null && <Said said={{ tone: 'bad', text: describeFailed.value }} />}
      {overviewRefused.value !== null && <Said said={{ tone: 'bad', text: overviewRefused.value }} />}
      {[...searchFailed.value].map(([line, why]) => (
        <p key={line} class="bad">
          ! {line}: {why}
        </p>
      ))}
      {all.length === 0 && (
        <p class="muted">
          {isSearched.value ? 'No motor was found. Check power and cables, then search again.' : searchText()}
        </p>
      )}
      <Nodes />
      <ul class="cards">
        {shownMotors.value.map(({ line, motor }) => (
          <Card key={nameOf(line, motor)} line={line} motor={motor} />
        ))}
      </ul>
      <Words of={MOTOR_WORDS} />
    </>
  );
}
