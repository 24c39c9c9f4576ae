// Ports that the computer of the server has, and those that are opened as new lines.
import { useSignal } from '@preact/signals';
import { useCallback, useEffect, useId } from 'preact/hooks';
import { welcome } from '../link';
import { Said, useSaid } from '../parts';
import { Confirm } from '../registers/confirm';
import type { FoundPort, Protocol, StoppedMotor } from '../wire';
import './connect.css';
import { askPorts } from './ask';
import { Scan } from './results';
import type { Wanted } from './scan';

const PROFILES = ['spec', 'mcsdk-5.4'] as const;

const isOperator = () => welcome.value?.role === 'operator';

/** How motors took the end of their line. */
export function closedText(line: string, motors: readonly StoppedMotor[]): string {
  const failed = motors.filter(({ failure }) => failure);
  if (failed.length) {
    const each = failed.map(({ motor, failure }) => `motor ${motor}: ${failure}`).join('; ');
    throw new Error(`${line} is closed, and motors may still be turning. ${each}`);
  }
  const stopped = motors.map(({ motor }) => motor).join(', ');
  return stopped ? `${line} is closed. Stopped before: motor ${stopped}.` : `${line} is closed.`;
}

function Found({ found, use }: { found: FoundPort; use: (port: FoundPort) => void }) {
  const { port, description, stable_path: stable, problem, line } = found;
  return (
    <li>
      <div>
        <code>{port}</code> {description && <span class="muted">{description}</span>}
        {stable && <div class="muted">always {stable}</div>}
        {problem && <div class="warn">! {problem}</div>}
      </div>
      {line && <span class="chip ok">● {line}</span>}
      {!line && isOperator() && (
        <button type="button" aria-label={`Use ${port}`} onClick={() => use(found)}>
          Use
        </button>
      )}
    </li>
  );
}

function OpenForm({ port, protocol, opened }: {
  port: { value: string };
  protocol: { value: Protocol };
  opened: () => void;
}) {
  const profile = useSignal<string>(PROFILES[0]);
  const timeout = useSignal('');
  const { said, attempt, isBusy } = useSaid();
  const id = useId();
  const wanted = (): Wanted => {
    const ms = timeout.value.trim() === '' ? null : Number(timeout.value);
    if (ms !== null && !(ms >= 1 && ms <= 60_000)) throw new Error('A reply timeout is 1 to 60000 ms.');
    return { port: port.value.trim(), protocol: protocol.value, timeout: ms === null ? null : ms / 1000 };
  };
  const open = () =>
    attempt(async () => {
      const one = wanted();
      const { line } = await askPorts({
        ask: 'open',
        ...one,
        profile: one.protocol === 'st' ? profile.value : null,
      });
      opened();
      return `${one.port} is open: it is the line ${line}.`;
    });
  return (
    <form
      class="connect-form"
      aria-label="Open a port"
      onSubmit={(event) => {
        event.preventDefault();
        void open();
      }}
    >
      <label class="wide">
        Port
        <input
          value={port.value}
          required
          maxLength={500}
          autocomplete="off"
          spellcheck={false}
          aria-describedby={`${id}-hint`}
          onInput={({ currentTarget }) => (port.value = currentTarget.value)}
        />
      </label>
      <p class="muted wide" id={`${id}-hint`}>
        As -p takes it: /dev/ttyACM0, /dev/ttyUSB0?baud=9600, slcan:/dev/ttyACM1, socketcan:can0, tcp:HOST:PORT.
        Scan asks what answers there, at each rate that the port can choose.
      </p>
      <label>
        Protocol
        <select
          value={protocol.value}
          onChange={({ currentTarget }) => (protocol.value = currentTarget.value as Protocol)}
        >
          <option value="st">ST (serial line)</option>
          <option value="rmd">RMD (CAN bus)</option>
        </select>
      </label>
      {protocol.value === 'st' && (
        <label>
          Profile
          <select value={profile.value} onChange={({ currentTarget }) => (profile.value = currentTarget.value)}>
            {PROFILES.map((one) => (
              <option key={one}>{one}</option>
            ))}
          </select>
        </label>
      )}
      <label>
        Reply timeout, ms
        <input
          inputMode="numeric"
          placeholder={protocol.value === 'st' ? '1000' : '50'}
          value={timeout.value}
          onInput={({ currentTarget }) => (timeout.value = currentTarget.value)}
        />
      </label>
      <button type="submit" disabled={isBusy || !port.value.trim()}>
        {isBusy ? 'Opening …' : 'Open'}
      </button>
      <Scan wanted={wanted} isReady={port.value.trim() !== ''} use={(found) => (port.value = found)} />
      <Said said={said} />
    </form>
  );
}

/** Ports that were found, and the form that opens one. */
export function Connect() {
  const ports = useSignal<readonly FoundPort[] | null>(null);
  const port = useSignal('');
  const protocol = useSignal<Protocol>('st');
  const { said, attempt, isBusy } = useSaid();
  const isThere = welcome.value !== null;
  const look = useCallback(
    () =>
      void attempt(async () => {
        ports.value = (await askPorts({ ask: 'ports' })).ports;
      }),
    [],
  );
  useEffect(() => {
    if (isThere) look();
  }, [isThere]);
  return (
    <section class="card connect" aria-label="Connect">
      <div class="bar">
        <h3>Connect</h3>
        <button type="button" disabled={isBusy || !isThere} onClick={look}>
          {isBusy ? 'Looking …' : 'Look for ports again'}
        </button>
      </div>
      {ports.value?.length === 0 && (
        <p class="muted">The computer of the server has no serial device and no CAN interface.</p>
      )}
      <ul class="found" aria-label="Ports of the computer">
        {ports.value?.map((found) => (
          <Found
            key={found.port}
            found={found}
            use={(one) => {
              port.value = one.port;
              protocol.value = one.protocol;
            }}
          />
        ))}
      </ul>
      <Said said={said} />
      {isOperator() ? (
        <OpenForm port={port} protocol={protocol} opened={look} />
      ) : (
        <p class="muted">Operators open and close lines. Viewers see them.</p>
      )}
    </section>
  );
}

/** Closes a line, after a question. `said` tells how its motors took it. */
export function CloseLine({ line, closed }: { line: string; closed: (what: () => Promise<string>) => void }) {
  const isAsked = useSignal(false);
  if (!isOperator()) return null;
  const close = () => closed(async () => closedText(line, (await askPorts({ ask: 'close', line })).motors));
  return (
    <>
      <button type="button" onClick={() => (isAsked.value = true)}>
        Close {line}
      </button>
      {isAsked.value && (
        <Confirm
          title={`Close ${line}?`}
          action="Close it"
          onDone={(isConfirmed) => {
            isAsked.value = false;
            if (isConfirmed) close();
          }}
        >
          <p>
            Motors that were started through {line} stop first. Then no page and no program can use the line: plots and
            recordings get no more values of it.
          </p>
        </Confirm>
      )}
    </>
  );
}
