// A register: its value, and its change in place.
import { Component, createRef } from 'preact';
import { duration, sentence } from '../format';
import { Confirm, RomWear } from '../registers/confirm';
import { access, isSame, numberOf, rangeText, withUnit } from '../registers/model';
import { type Cell, type Note, type Sheet, draft, note, read, reasonOf, write } from '../registers/values';
import type { Register } from '../wire';

interface Props {
  sheet: Sheet;
  register: Register;
  cell: Cell | undefined;
  /** What was typed and not written. */
  draft: string | undefined;
  note: Note | undefined;
  /** The value of the loaded file, if it differed when the file was compared. */
  inFile: string | undefined;
  /** In whole seconds. NaN: never read. */
  age: number;
  isOperator: boolean;
}

interface State {
  isWriting: boolean;
  /** The value that waits for a confirmation. */
  toRom: number | null;
}

/** A value that was read longer ago, in seconds, is not shown as live. */
const OLD = 3;

/** Draws again only if something of its own changed: a table has up to 137. */
export class RegisterRow extends Component<Props, State> {
  override state: State = { isWriting: false, toRom: null };
  private edit = createRef<HTMLButtonElement>();
  private input = createRef<HTMLInputElement>();

  override shouldComponentUpdate(next: Props, state: State) {
    const names = Object.keys(next) as (keyof Props)[];
    return state !== this.state || names.some((name) => !Object.is(next[name], this.props[name]));
  }

  override componentDidUpdate(before: Props) {
    if (before.draft === undefined && this.props.draft !== undefined) {
      this.input.current?.focus();
      this.input.current?.select();
    }
    // The focus stays where one was working.
    if (before.draft !== undefined && this.props.draft === undefined && document.activeElement === document.body) {
      this.edit.current?.focus();
    }
  }

  private begin = async () => {
    const { sheet, register } = this.props;
    const { name, readable } = register;
    note(sheet, name, null);
    // The value before the first change is what later ones are compared with.
    if (readable && !sheet.cells.value.has(name)) await read(sheet, [name]).catch(() => {});
    draft(sheet, name, sheet.cells.value.get(name)?.now.value?.toString() ?? '');
  };

  private cancel = () => {
    const { sheet, register } = this.props;
    note(sheet, register.name, null);
    draft(sheet, register.name, null);
  };

  private submit = (toRom: boolean) => {
    const { sheet, register, draft: text } = this.props;
    const checked = numberOf(text ?? '', register);
    if ('why' in checked) {
      note(sheet, register.name, { isBad: true, text: `Not sent. ${checked.why}` });
      this.input.current?.focus();
    } else if (toRom) this.setState({ toRom: checked.value });
    else void this.write(checked.value, false);
  };

  private async write(value: number, toRom: boolean) {
    const { sheet, register } = this.props;
    const { name } = register;
    this.setState({ isWriting: true, toRom: null });
    note(sheet, name, null);
    try {
      const values = await write(sheet, name, value, toRom);
      note(sheet, name, readBack(register, value, values.find((one) => one.name === name)));
    } catch (why) {
      note(sheet, name, { isBad: true, text: `Not confirmed: ${reasonOf(why)}` });
      // It is unknown what the register holds now.
      if (register.readable) await read(sheet, [name]).catch(() => {});
    }
    this.setState({ isWriting: false });
  }

  render() {
    const { sheet, register, cell, draft: text, note: remark, inFile, age, isOperator } = this.props;
    const { name, unit, writable, wears_rom: wearsRom, can_keep: canKeep } = register;
    const { isWriting, toRom } = this.state;
    const doc = sentence(register.doc.replaceAll('`', ''));
    const range = rangeText(register.range, unit);
    const hint = `${name}-hint`;
    return (
      <tr data-name={name}>
        <th scope="row">
          <code>{name}</code>
          {wearsRom && <span class="chip warn">ROM</span>}
          <span class="doc">{doc}</span>
          <span class="doc narrow">
            {access(register)}
            {range && `; range of the register: ${range}`}
          </span>
        </th>
        <td>
          {text === undefined ? (
            <div class="value">
              <Shown register={register} cell={cell} age={age} />
              {writable && isOperator && (
                <button type="button" ref={this.edit} onClick={this.begin} aria-label={`Change ${name}`}>
                  Change
                </button>
              )}
            </div>
          ) : (
            <form
              class="edit"
              aria-label={`Change ${name}`}
              onSubmit={(event) => {
                event.preventDefault();
                this.submit(wearsRom);
              }}
            >
              <input
                ref={this.input}
                inputMode="decimal"
                autocomplete="off"
                aria-label={`New value of ${name}${unit && ` in ${unit}`}`}
                aria-describedby={hint}
                aria-invalid={remark?.isBad || undefined}
                value={text}
                onInput={({ currentTarget }) => draft(sheet, name, currentTarget.value)}
                onKeyDown={({ key }) => {
                  if (key === 'Escape') this.cancel();
                }}
              />
              <span class="unit">{unit}</span>
              <button type="submit" class="primary" disabled={isWriting}>
                {isWriting ? 'Writing' : 'Write'}
              </button>
              {canKeep && (
                <button type="button" disabled={isWriting} onClick={() => this.submit(true)}>
                  Write to ROM …
                </button>
              )}
              <button type="button" onClick={this.cancel}>
                Cancel
              </button>
              <small id={hint}>
                <span class="chip warn">not written</span> now {cell?.now.text ?? 'not read'}
                <span class="narrow">{range}</span>
                {canKeep && <span class="keep">Without the ROM it holds until power-off.</span>}
              </small>
            </form>
          )}
          <Marks cell={cell} inFile={inFile} />
          <p class={remark?.isBad ? 'note bad' : 'ok remark'} role="status" hidden={!remark}>
            {remark && <span>{remark.text}</span>}
          </p>
          {toRom !== null && (
            <Confirm
              title={`Write ${name} to the ROM?`}
              action={`Write ${withUnit(toRom, unit)}`}
              onDone={(isConfirmed) =>
                isConfirmed ? void this.write(toRom, true) : this.setState({ toRom: null })
              }
            >
              <p>{doc}</p>
              <p>
                It is {cell?.now.text ?? 'not known'}, and becomes {withUnit(toRom, unit)}.
              </p>
              <RomWear motor={sheet.motor} />
            </Confirm>
          )}
        </td>
        <td class="wide">{range}</td>
        <td class="wide">{access(register)}</td>
      </tr>
    );
  }
}

function Shown({ register, cell, age }: { register: Register; cell: Cell | undefined; age: number }) {
  if (!register.readable) return <span class="muted">cannot be read</span>;
  if (!cell) return <span class="muted">not read</span>;
  if (cell.now.value === null) return <span class="muted refused">{cell.now.text || 'no value'}</span>;
  const isOld = age > OLD;
  return (
    <span class={isOld ? 'shown old' : 'shown'}>
      <output>{cell.now.text}</output> <span class="unit">{register.unit}</span>
      <small class="age">{isOld ? `${duration(age)} old` : ''}</small>
    </span>
  );
}

function Marks({ cell, inFile }: { cell: Cell | undefined; inFile: string | undefined }) {
  const isChanged = cell && cell.now.value !== null && cell.first.text !== cell.now.text;
  // The file was compared once. The register may have its value now.
  const differs = inFile !== undefined && !(cell && cell.now.value !== null && sameText(inFile, cell));
  if (!isChanged && !differs) return null;
  return (
    <div class="marks">
      {isChanged && <span class="chip warn">changed, was {cell.first.text}</span>}
      {differs && <span class="chip">≠ file: {inFile}</span>}
    </div>
  );
}

function sameText(inFile: string, { now }: Cell): boolean {
  return inFile === now.text || (inFile.trim() !== '' && Number(inFile) === now.value);
}

function readBack({ name, range, unit }: Register, value: number, read: { value: number | null; text: string } | undefined): Note {
  if (!read || read.value === null) {
    return { isBad: false, text: `Written. ${read?.text || `${name} cannot be read back.`}` };
  }
  const text = withUnit(read.text, unit);
  if (isSame(value, read.value, range?.[2] ?? 0)) return { isBad: false, text: `✓ Written, and read back: ${text}.` };
  return { isBad: true, text: `Written ${value}, but ${text} was read back.` };
}
