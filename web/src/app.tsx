// The frame of the page: header, stop, navigation, and what concerns all views.
import { useSignal } from '@preact/signals';
import { Component, type ComponentChildren, type ComponentType } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { watchDescriptions } from './drives';
import { faultSummary, watchFaults } from './faults';
import { sentence } from './format';
import { latchText } from './latch';
import { closedWhy, delay, lapsed, lastWelcome, shareLost, state, welcome } from './link';
import { Said, useSaid } from './parts';
import { RecordButton } from './record-button';
import { release, stopAll, stopReport } from './stop';
import { VIEWS, load, view } from './views';

const PHASES = { sent: 'warn', stopped: 'ok', unconfirmed: 'bad', refused: 'bad', unreachable: 'bad' } as const;
const SIGNS = { ok: '✓', warn: '…', bad: '!' } as const;

/** Acts when it is pressed, not when it is released. */
function StopAll() {
  const pressed = useRef(0);
  return (
    <button
      type="button"
      class="stop-all"
      aria-keyshortcuts="Escape Space"
      onPointerDown={({ button }) => {
        if (button !== 0) return;
        pressed.current = performance.now();
        stopAll();
      }}
      onClick={() => {
        if (performance.now() - pressed.current > 1000) stopAll();
      }}
    >
      STOP ALL<small aria-hidden="true">Esc or Space</small>
    </button>
  );
}

function Connection() {
  const ms = `${Math.round(delay.value)} ms`;
  switch (state.value) {
    case 'open':
      return (
        <span class="ok">
          ● Connected <span class="ms">{ms}</span>
        </span>
      );
    case 'silent':
      return (
        <span class="bad">
          ▲ No news for <span class="ms">{ms}</span>
        </span>
      );
    case 'lost':
      return <span class="bad">✕ Connection lost</span>;
    default:
      return <span class="muted">○ Connecting</span>;
  }
}

function Status() {
  const who = welcome.value;
  return (
    <div class="status">
      <span aria-label="Connection" role="group">
        <Connection />
      </span>
      <RecordButton />
      {who && (
        <span class="muted">
          {who.name}, {who.role}
        </span>
      )}
    </div>
  );
}

/** The faults of all motors, in every view. */
function FaultsOfAll() {
  useEffect(watchDescriptions, []);
  useEffect(watchFaults, []);
  const text = faultSummary.value;
  return (
    <span class="all-faults" role="status" aria-label="Faults of all motors">
      {text && (
        <a href="#/motors" class="bad" title={text}>
          ✕ {text}
        </a>
      )}
    </span>
  );
}

/** What is known of the last stop. */
function Report() {
  const report = stopReport.value;
  const tone = report ? PHASES[report.phase] : 'ok';
  const isDone = report?.phase === 'stopped' || report?.phase === 'unconfirmed';
  return (
    <div class="report">
      <strong role="status" aria-label="Stop" aria-live="assertive" class={tone}>
        {report && `${SIGNS[tone]} ${report.message}`}
      </strong>
      {(report?.failures || report?.note) && (
        <details>
          <summary>What each said</summary>
          {report.failures && (
            <ul tabIndex={0} aria-label="Motors that did not confirm">
              {report.failures.map((failure) => (
                <li key={failure}>{failure}</li>
              ))}
            </ul>
          )}
          {report.note && <p>{report.note}</p>}
        </details>
      )}
      {isDone && (
        <button type="button" onClick={() => (stopReport.value = null)}>
          Close<span class="hidden"> what is known of the stop</span>
        </button>
      )}
    </div>
  );
}

function Latch() {
  const { said, attempt, isBusy } = useSaid();
  const text = latchText.value;
  if (text === null) return null;
  return (
    <section class="note warn latch" aria-label="Latch">
      <p>
        <strong>{text}</strong> Motion is refused until the latch is released.
        {welcome.value?.role === 'viewer' && ' A viewer cannot release it.'}
      </p>
      {welcome.value?.role === 'operator' && (
        <button type="button" disabled={isBusy} onClick={() => attempt(release)}>
          Release
        </button>
      )}
      <Said said={said} />
    </section>
  );
}

function Banners() {
  const isLost = state.value === 'lost' || state.value === 'silent';
  return (
    <div class="banners">
      {isLost && (
        <section class="note bad" aria-label="Connection lost">
          <p>
            <strong>Values are old.</strong> {closedWhy.value && `${sentence(closedWhy.value)} `}If the server
            still runs, it stops the motors that this page turned when it hears nothing for{' '}
            {lastWelcome.value?.deadline ?? 300} ms. Motors of other programs keep turning.{' '}
            {lastWelcome.value?.separate_share
              ? 'If the server itself has ended, the share, which is another process, has stopped the motors of this page. '
              : 'If the server itself has ended or is frozen, only a guard or the power switch stops the motors. '}
            Was it started again? Then open the address that it printed.
          </p>
        </section>
      )}
      {shareLost.value !== null && (
        <section class="note bad" role="alert" aria-label="Share lost">
          <p>
            <strong>The share is lost.</strong> {sentence(shareLost.value)}
          </p>
        </section>
      )}
      {lapsed.value !== null && (
        <section class="note warn" role="alert" aria-label="Motors stopped">
          <p>
            <strong>The motors that this page turned were stopped.</strong> {sentence(lapsed.value)}
          </p>
          <button type="button" onClick={() => (lapsed.value = null)}>
            Close
          </button>
        </section>
      )}
    </div>
  );
}

/** An error in a view leaves the rest of the page, and the stop, as they are. */
class Contained extends Component<{ children: ComponentChildren }, { failure: string | null }> {
  override state = { failure: null as string | null };

  override componentDidCatch(error: unknown) {
    console.error(error);
    this.setState({ failure: error instanceof Error ? error.message : String(error) });
  }

  render() {
    const { failure } = this.state;
    if (failure === null) return this.props.children;
    return (
      <p class="note bad" role="alert">
        <span>This view has failed: {failure}. Stop all still works. Load the page again to use the view.</span>
      </p>
    );
  }
}

function Current() {
  const shown = useSignal<{ path: string; component: ComponentType | null } | null>(null);
  const wanted = view.value;
  useEffect(() => {
    let isWanted = true;
    load(wanted).then(
      (component) => {
        if (isWanted) shown.value = { path: wanted.path, component };
      },
      () => {
        if (isWanted) shown.value = { path: wanted.path, component: null };
      },
    );
    return () => void (isWanted = false);
  }, [wanted]);
  const now = shown.value;
  if (now?.path !== wanted.path) return <p class="muted">Loading {wanted.title} …</p>;
  if (!now.component) return <p>{wanted.title} could not be loaded. Load the page again.</p>;
  const View = now.component;
  return (
    <Contained key={wanted.path}>
      <View />
    </Contained>
  );
}

function Navigation() {
  return (
    <nav class="views" aria-label="Views">
      <ul>
        {VIEWS.map(({ path, title }) => (
          <li key={path}>
            <a href={`#/${path}`} aria-current={view.value.path === path ? 'page' : undefined}>
              {title}
            </a>
          </li>
        ))}
      </ul>
    </nav>
  );
}

export function App() {
  return (
    <>
      <div class="top">
        <header>
          <h1>Motorlink</h1>
          <StopAll />
          <div class="line">
            <Status />
            <FaultsOfAll />
            <Report />
          </div>
          <Latch />
        </header>
        <Navigation />
      </div>
      <Banners />
      <main>
        <Current />
      </main>
    </>
  );
}
