// Files of settings: download, compare, restore.
import { useSignal } from '@preact/signals';
import { nameOf, sentence } from '../format';
import { Refused, ask } from '../link';
import { Said, useSaid } from '../parts';
import { Confirm, RomWear } from '../registers/confirm';
import { type Sheet, compare, read, reasonOf } from '../registers/values';
import { download } from '../registers/download';
import type { Description, Difference } from '../wire';

/** The server takes texts of 64 KiB. A file of settings has about 4. */
const LONGEST = 48_000;

export function Settings({
  sheet, description, isOperator,
}: {
  sheet: Sheet;
  description: Description;
  isOperator: boolean;
}) {
  const { said, attempt, isBusy } = useSaid();
  const warnings = useSignal<readonly string[]>([]);
  const written = useSignal<readonly Difference[] | null>(null);
  const isAsking = useSignal(false);
  const toRom = useSignal(false);
  const file = sheet.file.value;
  const differences = file ? [...file.differences.values()] : [];
  const hasRom = description.registers.some(({ wears_rom: wearsRom, can_keep: canKeep }) => wearsRom || canKeep);
  const needRom = differences.filter((one) => one.wears_rom && one.fixed === null);
  const possible = differences.filter((one) => one.fixed === null && (toRom.value || !one.wears_rom));
  const motor = nameOf(sheet.motor.line, sheet.motor.motor);

  const dump = () =>
    attempt(async () => {
      warnings.value = [];
      const answer = await ask({ ask: 'dump', ...sheet.motor }).catch(fail('There is no file'));
      warnings.value = answer.warnings;
      download(answer.file, answer.text, 'application/toml');
      return `${answer.file} was saved.`;
    });
  const load = (chosen: File) =>
    attempt(async () => {
      written.value = null;
      sheet.file.value = null;
      if (chosen.size > LONGEST) throw new Error(`${chosen.name} is longer than a file of settings.`);
      const loaded = await compare(sheet, chosen.name, await chosen.text()).catch((why: unknown) => {
        const isNoFile = why instanceof Refused && why.reason === 'usage';
        return fail(`${chosen.name} was not compared${isNoFile ? `. ${noFile(description)}` : ''}`)(why);
      });
      const { size } = loaded.differences;
      if (!size) return 'No setting differs.';
      return { tone: 'note', text: `${size} ${size === 1 ? 'setting differs' : 'settings differ'}.` };
    });
  const restore = () =>
    attempt(async () => {
      isAsking.value = false;
      written.value = null;
      if (!file) return;
      const count = possible.length;
      try {
        const answer = await ask({ ask: 'restore', ...sheet.motor, text: file.text, to_rom: toRom.value });
        written.value = answer.written;
      } catch (why) {
        const rest = await stillDiffers(sheet);
        throw new Error(`The file was not restored as a whole: ${reasonOf(why)} ${rest}`);
      }
      const known = new Set(description.registers.filter(({ readable }) => readable).map(({ name }) => name));
      await read(sheet, written.value.map(({ name }) => name).filter((name) => known.has(name))).catch(() => {});
      const rest = await stillDiffers(sheet);
      return `${written.value.length} of ${count} settings were written and read back. ${rest}`;
    });

  return (
    <details class="part">
      <summary>Settings files: save, compare, restore</summary>
      <div class="bar">
        <button type="button" disabled={isBusy} onClick={dump}>
          Save settings of {motor}
        </button>
        <label class="labelled file">
          <span>Compare with a file</span>
          <input
            type="file"
            accept=".toml,text/plain"
            disabled={isBusy}
            // A file that was changed can be chosen again.
            onClick={({ currentTarget }) => (currentTarget.value = '')}
            onChange={({ currentTarget }) => {
              const chosen = currentTarget.files?.[0];
              if (chosen) void load(chosen);
            }}
          />
        </label>
      </div>
      <Said said={said} />
      {warnings.value.length > 0 && (
        <section class="note">
          <h4>Not complete</h4>
          <ul>
            {warnings.value.map((warning) => (
              <li key={warning}>{inWords(warning)}</li>
            ))}
          </ul>
        </section>
      )}
      {file && differences.length > 0 && (
        <>
          <Differences differences={differences} caption={`Differences between motor ${motor} and ${file.name}`} />
          {isOperator && (
            <div class="bar">
              {hasRom && (
                <label class="check">
                  <input
                    type="checkbox"
                    checked={toRom.value}
                    onChange={({ currentTarget }) => (toRom.value = currentTarget.checked)}
                  />
                  <span>Also write the ROM, which wears it</span>
                </label>
              )}
              <button
                type="button"
                class="primary"
                disabled={isBusy || !possible.length}
                onClick={() => {
                  if (toRom.value) isAsking.value = true;
                  else void restore();
                }}
              >
                Write {possible.length} {possible.length === 1 ? 'setting' : 'settings'}
              </button>
              <span class="muted">The motor has to be at rest.</span>
              {needRom.length > 0 && !toRom.value && (
                <span class="muted">{names(needRom)} can be written to the ROM only.</span>
              )}
            </div>
          )}
        </>
      )}
      {written.value && written.value.length > 0 && (
        <Differences differences={written.value} caption="Written, and read back" isWritten />
      )}
      {isAsking.value && (
        <Confirm
          title="Write the file to the ROM, too?"
          action={`Write ${possible.length} settings`}
          onDone={(isConfirmed) => {
            isAsking.value = false;
            if (isConfirmed) void restore();
          }}
        >
          {needRom.length > 0 && <p>In the ROM only: {names(needRom)}.</p>}
          <RomWear motor={sheet.motor} />
        </Confirm>
      )}
    </details>
  );
}

/** A setting that is not in a file that was saved, and why. */
function inWords(warning: string): string {
  const [, name] = /^the motor refuses to read (.+)$/.exec(warning) ?? [];
  return name ? `Not in the file, because the motor does not let it be read: ${name}.` : sentence(warning);
}

function noFile({ protocol }: Description): string {
  return (
    'This is not a settings file for this motor: use one from "Save settings" or ' +
    `\`motorlink ${protocol} dump\`. What is wrong with it`
  );
}

function names(differences: readonly Difference[]): string {
  return differences.map(({ name }) => name).join(', ');
}

/** What still differs after a restore. The file is compared again. */
async function stillDiffers(sheet: Sheet): Promise<string> {
  const file = sheet.file.value;
  if (!file) return '';
  try {
    const { differences } = await compare(sheet, file.name, file.text);
    return differences.size
      ? `These still differ: ${names([...differences.values()])}.`
      : 'Nothing differs from the file now.';
  } catch (why) {
    return `What differs now is unknown: ${reasonOf(why)}`;
  }
}

const fail = (what: string) => (why: unknown): never => {
  if (why instanceof Refused) throw new Error(`${what}: ${reasonOf(why)}`);
  throw why;
};

function Differences({
  differences, caption, isWritten = false,
}: {
  differences: readonly Difference[];
  caption: string;
  isWritten?: boolean;
}) {
  return (
    <table class="differences">
      <caption>{caption}</caption>
      <thead>
        <tr>
          <th scope="col">Setting</th>
          <th scope="col">{isWritten ? 'Before' : 'Motor'}</th>
          <th scope="col">{isWritten ? 'Now' : 'File'}</th>
          <th scope="col">{isWritten ? 'ROM' : 'Can it be written?'}</th>
        </tr>
      </thead>
      <tbody>
        {differences.map(({ name, unit, now, file, wears_rom: wearsRom, fixed }) => (
          <tr key={name}>
            <th scope="row">
              <code>{name}</code>
            </th>
            <td>
              {now} {unit}
            </td>
            <td>
              {file} {unit}
            </td>
            <td>
              {isWritten ? (wearsRom ? 'written to the ROM' : '') : (fixed ?? (wearsRom ? 'yes, at rest; it wears the ROM' : 'yes, at rest'))}
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
