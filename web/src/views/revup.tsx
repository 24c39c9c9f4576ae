// The rev-up table of an ST motor: how it starts without a sensor, phase by phase.
import { useSignal } from '@preact/signals';
import { ask } from '../link';
import { Said, useSaid } from '../parts';
import type { Command } from '../wire';
import './revup.css';

/** The commands that read and write a phase, and the value that says which. */
export const REVUP = { read: 'GET_REVUP_DATA', write: 'SET_REVUP_DATA', phase: 'phase' } as const;

interface Props {
  line: string;
  motor: number;
  /** The command that writes a phase. */
  write: Command;
  mayMove: boolean;
}

export function RevUp({ line, motor, write, mayMove }: Props) {
  const { said, attempt, isBusy } = useSaid();
  /** Texts of all phases, by name of the value. */
  const phases = useSignal<Readonly<Record<string, string>>[]>([]);
  const [least, most] = write.fields.find(({ name }) => name === REVUP.phase)?.range ?? [0, -1];
  const columns = write.fields.filter(({ name }) => name !== REVUP.phase);

  const read = async (phase: number) => {
    const values = { [REVUP.phase]: phase };
    const answer = await ask({ ask: 'act', line, motor, command: REVUP.read, values, hold: false });
    return Object.fromEntries(answer.values.map(({ name, value }) => [name, value === null ? '' : String(value)]));
  };
  const readAll = async () => {
    const found = [];
    for (let phase = least; phase <= most; phase += 1) found.push(await read(phase));
    phases.value = found;
  };
  const save = async (at: number) => {
    const phase = least + at;
    const values: Record<string, number> = { [REVUP.phase]: phase };
    for (const { name } of columns) {
      const text = phases.value[at]?.[name] ?? '';
      if (text.trim() === '' || !Number.isFinite(Number(text))) throw new Error(`${name}: give a number.`);
      values[name] = Number(text);
    }
    await ask({ ask: 'act', line, motor, command: REVUP.write, values, hold: false });
    const kept = await read(phase);
    phases.value = phases.value.map((one, other) => (other === at ? kept : one));
    const differs = columns.filter(({ name }) => Number(kept[name]) !== values[name]).map(({ name }) => name);
    if (differs.length) throw new Error(`The drive has other values now: ${differs.join(', ')}.`);
    return `Phase ${phase} was written and read back.`;
  };

  return (
    <section class="revup" aria-label="Rev-up table">
      <div class="bar">
        <h4>Rev-up table</h4>
        <button type="button" disabled={!mayMove || isBusy} onClick={() => attempt(readAll)}>
          Read
        </button>
      </div>
      {phases.value.length > 0 && (
        <div class="scrolled" tabIndex={0} role="region" aria-label="Phases of the rev-up">
          <table>
            <thead>
              <tr>
                <th scope="col">Phase</th>
                {columns.map(({ name, doc }) => (
                  <th key={name} scope="col" title={doc}>
                    {name}
                  </th>
                ))}
                <th scope="col">
                  <span class="hidden">Write</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {phases.value.map((values, at) => (
                <tr key={at}>
                  <th scope="row">{least + at}</th>
                  {columns.map(({ name }) => (
                    <td key={name}>
                      <input
                        type="number"
                        step="any"
                        aria-label={`${name} of phase ${least + at}`}
                        value={values[name] ?? ''}
                        onInput={({ currentTarget }) => {
                          const text = currentTarget.value;
                          phases.value = phases.value.map((one, other) =>
                            other === at ? { ...one, [name]: text } : one,
                          );
                        }}
                      />
                    </td>
                  ))}
                  <td>
                    <button
                      type="button"
                      disabled={!mayMove || isBusy}
                      aria-label={`Write phase ${least + at}`}
                      onClick={() => attempt(() => save(at))}
                    >
                      Write
                    </button>
                  </td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      <Said said={said} />
    </section>
  );
}
