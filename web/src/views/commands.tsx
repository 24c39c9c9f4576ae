// All commands of the protocol, with their values.
import { useSignal } from '@preact/signals';
import { afterAcknowledge } from '../acknowledge';
import { COMMANDS, descriptions } from '../drives';
import { sentence } from '../format';
import { ask, lapsed } from '../link';
import { Said, useSaid } from '../parts';
import { REVUP, RevUp } from './revup';
import type { Command } from '../wire';

interface Props {
  line: string;
  motor: number;
  commands: readonly Command[];
  isHold: boolean;
  mayMove: boolean;
}

export function Commands({ line, motor, commands, isHold, mayMove }: Props) {
  const isOpen = useSignal(false);
  const named = (wanted: string) => commands.find(({ name }) => name === wanted);
  const revUp = named(REVUP.read) && named(REVUP.write);
  return (
    <details onToggle={({ currentTarget }) => (isOpen.value = currentTarget.open)}>
      <summary>More commands</summary>
      {isOpen.value && (
        <div class="commands">
          {revUp && <RevUp line={line} motor={motor} write={revUp} mayMove={mayMove} />}
          {commands.map((command) => (
            <One
              key={command.name}
              line={line}
              motor={motor}
              command={command}
              mayMove={mayMove}
              refused={isHold && command.moves ? 'Hold to run is on: only the held button moves the motor.' : null}
            />
          ))}
        </div>
      )}
    </details>
  );
}

/** A bound of a range, short. */
const bound = (value: number) => (Math.abs(value) < 1e6 ? String(value) : value.toExponential(1).replace('-', '−'));

interface OneProps {
  line: string;
  motor: number;
  command: Command;
  mayMove: boolean;
  /** Why it is not possible now. */
  refused: string | null;
}

function One({ line, motor, command: { name, doc, fields, moves, wears_rom }, mayMove, refused }: OneProps) {
  const { said, attempt, isBusy } = useSaid();
  const values = useSignal<Readonly<Record<string, string>>>({});
  const isAllowed = useSignal(false);

  const send = async () => {
    const numbers: Record<string, number> = {};
    for (const field of fields) {
      const text = (values.value[field.name] ?? '').trim();
      const value = Number(text);
      if (text === '' || !Number.isFinite(value)) {
        throw new Error(`${field.name}: ${field.words.length ? 'choose one' : 'give a number'}.`);
      }
      numbers[field.name] = value;
    }
    if (moves) lapsed.value = null;
    const answer = await ask({ ask: 'act', line, motor, command: name, values: numbers, hold: false, to_rom: wears_rom });
    isAllowed.value = false;
    const protocol = descriptions.peek().get(line)?.protocol;
    if (protocol && name === COMMANDS[protocol].acknowledge) return afterAcknowledge(line, motor);
    const texts = answer.values.map((value) => `${value.name} ${value.text}`);
    return texts.length ? texts.join(', ') : 'The drive acknowledged it.';
  };

  return (
    <form
      aria-label={name}
      onSubmit={(event) => {
        event.preventDefault();
        void attempt(send);
      }}
    >
      <div>
        <h4>
          <code>{name}</code>
          {moves && <span class="muted"> may move the motor</span>}
        </h4>
        <p class="muted">{sentence(doc)}</p>
      </div>
      {fields.length > 0 && (
        <div class="fields">
          {fields.map((field) => {
            const [least, most] = field.range;
            const set = (text: string) => void (values.value = { ...values.value, [field.name]: text });
            const text = values.value[field.name] ?? '';
            if (field.words.length) {
              return (
                <label key={field.name} title={field.doc}>
                  {field.name}
                  <select value={text} disabled={!mayMove} onChange={({ currentTarget }) => set(currentTarget.value)}>
                    <option value="">choose</option>
                    {field.words.map((word, value) => (
                      <option key={word} value={value}>
                        {word}
                      </option>
                    ))}
                  </select>
                </label>
              );
            }
            return (
              <label key={field.name} title={field.doc}>
                {field.name}
                {field.unit && `, ${field.unit}`}: {bound(least)} to {bound(most)}
                <input
                  type="number"
                  step="any"
                  value={text}
                  disabled={!mayMove}
                  onInput={({ currentTarget }) => set(currentTarget.value)}
                />
              </label>
            );
          })}
        </div>
      )}
      {wears_rom && (
        <label class="switch">
          <input
            type="checkbox"
            checked={isAllowed.value}
            disabled={!mayMove}
            onChange={({ currentTarget }) => (isAllowed.value = currentTarget.checked)}
          />
          Write to ROM. Each write wears it.
        </label>
      )}
      {refused !== null && <p class="muted">{refused}</p>}
      <button
        type="submit"
        disabled={!mayMove || isBusy || refused !== null || (wears_rom && !isAllowed.value)}
        aria-label={`Send ${name}`}
      >
        Send
      </button>
      <Said said={said} />
    </form>
  );
}
