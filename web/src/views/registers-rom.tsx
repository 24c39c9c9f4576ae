// Commands that write the ROM of a motor and move nothing.
import { useSignal } from '@preact/signals';
import { sentence } from '../format';
import { ask } from '../link';
import { Said, useSaid } from '../parts';
import { Confirm, RomWear } from '../registers/confirm';
import { numberOf, rangeText } from '../registers/model';
import { type Sheet, reasonOf } from '../registers/values';
import type { Command, Description, Field } from '../wire';

export function RomCommands({ sheet, description }: { sheet: Sheet; description: Description }) {
  const commands = description.commands.filter(({ wears_rom: wearsRom, moves }) => wearsRom && !moves);
  if (!commands.length) return null;
  return (
    <details class="part">
      <summary>Commands that write the ROM</summary>
      {commands.map((command) => (
        <RomCommand key={command.name} sheet={sheet} command={command} />
      ))}
    </details>
  );
}

function RomCommand({ sheet, command }: { sheet: Sheet; command: Command }) {
  const texts = useSignal<Record<string, string>>({});
  const confirming = useSignal<Record<string, number> | null>(null);
  const { said, attempt, isBusy } = useSaid();

  const set = ({ name }: Field, text: string) => (texts.value = { ...texts.value, [name]: text });
  const check = () =>
    attempt(async () => {
      const values: Record<string, number> = {};
      for (const field of command.fields) {
        const checked = numberOf(texts.value[field.name] ?? '', field);
        if ('why' in checked) throw new Error(`Not sent. ${field.name}: ${checked.why}`);
        values[field.name] = checked.value;
      }
      confirming.value = values;
    });
  const send = (values: Record<string, number>) =>
    attempt(async () => {
      const answer = await ask({
        ask: 'act', ...sheet.motor, command: command.name, values, hold: false, to_rom: true,
      }).catch((why: unknown) => {
        throw new Error(reasonOf(why));
      });
      const reply = answer.values.map(({ name, text }) => `${name} ${text}`).join(', ');
      return `The motor acknowledged ${command.name}${reply && `: ${reply}`}.`;
    });
  return (
    <form
      class="rom"
      aria-label={command.name}
      onSubmit={(event) => {
        event.preventDefault();
        void check();
      }}
    >
      <p>
        <code>{command.name}</code> <span class="doc">{sentence(command.doc)}</span>
      </p>
      {command.fields.map((field) => (
        <label class="labelled" key={field.name}>
          <span>{field.name}</span>
          {field.words.length > 0 ? (
            <select value={texts.value[field.name] ?? ''} onChange={({ currentTarget }) => set(field, currentTarget.value)}>
              <option value="">choose</option>
              {field.words.map((word, index) => (
                <option key={word} value={String(index)}>
                  {word}
                </option>
              ))}
            </select>
          ) : (
            <input
              inputMode="decimal"
              autocomplete="off"
              title={field.doc}
              placeholder={rangeText(field.range)}
              value={texts.value[field.name] ?? ''}
              onInput={({ currentTarget }) => set(field, currentTarget.value)}
            />
          )}
        </label>
      ))}
      <button type="submit" disabled={isBusy}>
        Write the ROM …
      </button>
      <Said said={said} />
      {confirming.value && (
        <Confirm
          title={`Send ${command.name}?`}
          action="Write the ROM"
          onDone={(isConfirmed) => {
            const values = confirming.value;
            confirming.value = null;
            if (isConfirmed && values) void send(values);
          }}
        >
          <p>{sentence(command.doc)}</p>
          {Object.entries(confirming.value).map(([name, value]) => (
            <p key={name}>
              {name}: {value}
            </p>
          ))}
          <RomWear motor={sheet.motor} />
        </Confirm>
      )}
    </form>
  );
}
