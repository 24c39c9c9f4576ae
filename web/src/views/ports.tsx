// The lines that the share holds, and how often signals are read from them.
import { useEffect } from 'preact/hooks';
import { isRead, isSilent, lineEvents, rates, watchRates } from '../drives';
import { nameOf, rate, timeOfDay } from '../format';
import { entries, lines, motors, refreshLines, refreshMotors, searchFailed, searching, unconfirmed, welcome } from '../link';
import type { Line, LineCounts } from '../wire';
import { Said, useSaid } from '../parts';
import { CloseLine, Connect } from '../connect/connect';
import './ports.css';

/** The time between two looks at the counts, in ms. */
const COUNTS = 2000;

/** Events that say that something went wrong on a line. */
const COUNTED = { lost: 'lost', silent: 'silent', doubtful: 'doubtful replies', refused: 'refused' } as const;

function incidents(line: string): string {
  const texts = Object.entries(COUNTED).flatMap(([kind, title]) => {
    const count = entries.value.filter((one) => one.line === line && one.event === kind).length;
    return count ? [`${count} × ${title}`] : [];
  });
  const rows = unconfirmed.value.get(line) ?? 0;
  if (rows) texts.push(`${rows} × values left out without confirmation`);
  return `${texts.join(', ') || 'none'} since this page was opened`;
}

/** What went wrong on a line since the server opened it. */
function errors({ exchanges, silent, refused, failed, lost }: LineCounts): string {
  const times = lost === 1 ? 'once' : `${lost} times`;
  return (
    `${silent} without reply, ${refused} refused, ${failed} failed, of ${exchanges} exchanges ` +
    '(searches of empty addresses count); ' +
    `${lost ? `port lost ${times}` : 'port never lost'}`
  );
}

function LineState({ line }: { line: string }) {
  const last = lineEvents.value.get(line);
  const found = motors.value.get(line) ?? [];
  const answers = rates.value.some((one) => one.line === line && isRead(one));
  if (last?.event === 'lost') {
    return (
      <>
        <span class="chip bad">✕ lost</span> since {timeOfDay(last.wall)}: {last.message}
      </>
    );
  }
  if (found.length > 0 && found.every((motor) => isSilent(line, motor))) {
    return (
      <>
        <span class="chip bad">✕ silent</span> no motor answers
      </>
    );
  }
  if (answers) return <span class="chip ok">● answers</span>;
  if (last) {
    return (
      <>
        <span class="chip ok">● open</span> {last.event === 'back' && 'again '}since {timeOfDay(last.wall)}
      </>
    );
  }
  return (
    <>
      <span class="chip">○ open</span> nothing is read
    </>
  );
}

interface Close {
  (what: () => Promise<string>): void;
}

function Port({ close, line: { line, protocol, port, profile, timeout, counts } }: { line: Line; close: Close }) {
  const found = motors.value.get(line) ?? [];
  const isBusy = searching.value.has(line);
  const failure = searchFailed.value.get(line);
  return (
    <li>
      <article class="card" aria-label={`Line ${line}`}>
        <div class="bar">
          <h3>{line}</h3>
          <button type="button" disabled={isBusy || !welcome.value} onClick={() => void refreshMotors(line)}>
            {isBusy ? 'Searching …' : 'Search motors again'}
          </button>
          <CloseLine line={line} closed={close} />
        </div>
        <dl class="facts">
          <dt>State</dt>
          <dd>
            <LineState line={line} />
          </dd>
          <dt>Port</dt>
          <dd class="mono">{port}</dd>
          <dt>Protocol</dt>
          <dd>
            {protocol.toUpperCase()}
            {profile && `, profile ${profile}`}
          </dd>
          <dt>Reply timeout</dt>
          <dd>{Math.round(timeout * 1000)} ms</dd>
          <dt>Motors</dt>
          <dd>
            {found.length === 0 && (isBusy ? 'searching' : 'none found')}
            {found.map((motor) => {
              const silent = isSilent(line, motor);
              return (
                <span key={motor} class={silent ? 'motor bad' : 'motor'}>
                  {motor}
                  {silent && ' (silent)'}
                </span>
              );
            })}
          </dd>
          {counts && (
            <>
              <dt>Errors</dt>
              <dd>{errors(counts)}</dd>
            </>
          )}
          <dt>Incidents</dt>
          <dd>{incidents(line)}</dd>
        </dl>
        <p role="status" class="bad">
          {failure !== undefined && `! ${failure}`}
        </p>
      </article>
    </li>
  );
}

function Rates() {
  const all = rates.value;
  if (all.length === 0) return <p class="muted">No signal is read now. Each page reads the faults of all motors while it is visible, Motors and Plots also other signals.</p>;
  return (
    <div class="scrolled" tabIndex={0} role="region" aria-label="Rates of signals">
      <table>
        <thead>
          <tr>
            <th scope="col">Signal</th>
            <th scope="col" class="number">
              Asked
            </th>
            <th scope="col" class="number">
              Possible
            </th>
            <th scope="col" class="number">
              Achieved
            </th>
          </tr>
        </thead>
        <tbody>
          {all.map(({ line, motor, name, asked, predicted, achieved }) => (
            <tr key={`${nameOf(line, motor)} ${name}`}>
              <td>
                {nameOf(line, motor)} <code>{name}</code>
              </td>
              <td class="number">{rate(1 / asked)}</td>
              <td class="number">{rate(1 / predicted)}</td>
              <td class="number">
                {achieved < 0.8 / asked && <span class="warn">▼ </span>}
                {rate(achieved)}
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

export default function Ports() {
  useEffect(() => watchRates(), []);
  useEffect(() => {
    void refreshLines();
    const timer = setInterval(() => void refreshLines(), COUNTS);
    return () => clearInterval(timer);
  }, []);
  const { said, attempt } = useSaid();
  const close: Close = (what) => void attempt(what);
  return (
    <>
      <div class="bar">
        <h2>Ports</h2>
      </div>
      <Said said={said} />
      {lines.value.length === 0 && <p class="muted">The server has not said yet which lines it holds.</p>}
      <ul class="ports">
        {lines.value.map((line) => (
          <Port key={line.line} line={line} close={close} />
        ))}
      </ul>
      <Connect />
      <h3 class="apart">Rates</h3>
      <Rates />
    </>
  );
}
