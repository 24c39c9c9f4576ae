// The registers of a motor: read, changed in place, and compared with a file.
import { effect, useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { descriptions } from '../drives';
import { nameOf } from '../format';
import { events, state, welcome } from '../link';
import { Said, useSaid } from '../parts';
import { found, groups } from '../registers/model';
import { MotorPicker } from '../registers/picker';
import { type Sheet, chosen, isStopOf, read, reasonOf, sheetOf } from '../registers/values';
import type { Description, Register } from '../wire';
import { RegisterRow } from './registers-row';
import { RomCommands } from './registers-rom';
import './registers.css';
import { Settings } from './settings';
import { Words } from '../words';

const REGISTER_WORDS = ['s16A', 's16V', 's16degree', 'dpp', 'ROM'] as const;

/** How often the registers in view are read if that is switched on, in ms. */
const AGAIN = 2000;
/** When registers are read after a stop, in ms: a motor slows down for some time. */
const AFTER_STOP = [200, 2000, 5000, 10_000];
/** Rows that come into view while one scrolls are read together after this time, in ms. */
const REST = 150;

export default function Registers() {
  const motor = chosen.value;
  const description = motor && descriptions.value.get(motor.line);
  return (
    <div class="registers">
      <div class="bar">
        <h2>Registers</h2>
        <MotorPicker />
      </div>
      {motor && description ? (
        <Motor key={nameOf(motor.line, motor.motor)} sheet={sheetOf(motor)} description={description} />
      ) : (
        <p class="muted">Waiting for a motor and its registers …</p>
      )}
    </div>
  );
}

function Motor({ sheet, description }: { sheet: Sheet; description: Description }) {
  const isOperator = welcome.value?.role === 'operator';
  return (
    <>
      {welcome.value?.role === 'viewer' && (
        <p class="note">
          <span>You are a viewer. You can read registers and compare files, but not write.</span>
        </p>
      )}
      <Settings sheet={sheet} description={description} isOperator={isOperator} />
      {isOperator && <RomCommands sheet={sheet} description={description} />}
      <Table sheet={sheet} description={description} isOperator={isOperator} />
    </>
  );
}

function Table({ sheet, description, isOperator }: { sheet: Sheet; description: Description; isOperator: boolean }) {
  const search = useSignal('');
  const isOnlyChanged = useSignal(false);
  const isLive = useSignal(false);
  const { said, attempt } = useSaid();
  const now = useSignal(performance.now());
  const cells = sheet.cells.value;
  const file = sheet.file.value;
  const drafts = sheet.drafts.value;
  const notes = sheet.notes.value;

  const matching = useMemo(
    () => found(description.registers, search.value),
    [description.registers, search.value],
  );
  const shown = isOnlyChanged.value
    ? matching.filter(({ name }) => {
        const cell = cells.get(name);
        return drafts.has(name) || (cell && cell.first.text !== cell.now.text) || file?.differences.has(name);
      })
    : matching;
  const { body, inView } = useRowsInView(sheet, description.registers, shown);
  useReadAfterStop(sheet, inView);

  useEffect(() => {
    const timer = setInterval(() => (now.value = performance.now()), 1000);
    return () => clearInterval(timer);
  }, []);

  useEffect(() => {
    if (!isLive.value) return;
    let isWanted = true;
    let timer: ReturnType<typeof setTimeout>;
    const again = async () => {
      const began = performance.now();
      if (state.value === 'open' && !document.hidden) {
        await attempt(() => read(sheet, inView(), () => isWanted).catch(failed));
      }
      if (isWanted) timer = setTimeout(again, Math.max(100, AGAIN - (performance.now() - began)));
    };
    void again();
    return () => {
      isWanted = false;
      clearTimeout(timer);
    };
  }, [isLive.value]);

  const readable = shown.filter((register) => register.readable).map(({ name }) => name);
  const unreadable = shown.filter((register) => !register.readable).map(({ name }) => name);
  const readShown = async () => {
    await read(sheet, readable).catch(failed);
    return `${readable.length} registers were read.`;
  };
  return (
    <section aria-label="Table of registers">
      <div class="bar tools">
        <label class="labelled search">
          <span>Search</span>
          <input
            type="search"
            placeholder="name, meaning, unit, group"
            value={search.value}
            onInput={({ currentTarget }) => (search.value = currentTarget.value)}
          />
        </label>
        <button type="button" disabled={sheet.reading.value > 0 || !readable.length} onClick={() => attempt(readShown)}>
          Read {readable.length}
        </button>
        <label class="check">
          <input
            type="checkbox"
            checked={isLive.value}
            onChange={({ currentTarget }) => (isLive.value = currentTarget.checked)}
          />
          <span>Read those in view every 2 s</span>
        </label>
        <label class="check">
          <input
            type="checkbox"
            checked={isOnlyChanged.value}
            onChange={({ currentTarget }) => (isOnlyChanged.value = currentTarget.checked)}
          />
          <span>Only changed</span>
        </label>
      </div>
      <p class="muted count" aria-live="polite">
        {shown.length} of {description.registers.length} registers
        {unreadable.length > 0 && `; cannot be read, only written: ${unreadable.join(', ')}`}
        {drafts.size > 0 && `, ${drafts.size} with a value that is not written`}
      </p>
      {!isLive.value && <p class="muted count">Values are read once, and again after a stop. "Read" reads them again.</p>}
      <Said said={said} />
      <table class="sheet" ref={body}>
        <caption class="hidden">Registers of motor {nameOf(sheet.motor.line, sheet.motor.motor)}</caption>
        <thead>
          <tr>
            <th scope="col">Register</th>
            <th scope="col">Value</th>
            <th scope="col" class="wide">
              Range of the register
            </th>
            <th scope="col" class="wide">
              Access
            </th>
          </tr>
        </thead>
        {groups(shown).map(({ group, registers }) => (
          <tbody key={group}>
            <tr class="group">
              <th scope="rowgroup" colSpan={2}>
                {group}
              </th>
              <td class="wide" colSpan={2} />
            </tr>
            {registers.map((register) => (
              <RegisterRow
                key={register.name}
                sheet={sheet}
                register={register}
                cell={cells.get(register.name)}
                draft={drafts.get(register.name)}
                note={notes.get(register.name)}
                inFile={file?.differences.get(register.name)?.file}
                age={ageOf(cells.get(register.name)?.at, now.value)}
                isOperator={isOperator}
              />
            ))}
          </tbody>
        ))}
      </table>
      {shown.length === 0 && <p class="muted">No register matches.</p>}
      <Words of={REGISTER_WORDS} />
    </section>
  );
}

function failed(why: unknown): never {
  throw new Error(`Not all registers were read: ${reasonOf(why)}`);
}

/** In whole seconds, so that rows are only drawn again when their text changes. */
function ageOf(at: number | undefined, now: number): number {
  return at === undefined ? NaN : Math.max(0, Math.floor((now - at) / 1000));
}

/** Reads the registers in view after a stop of the motor, and again while it slows down. */
function useReadAfterStop(sheet: Sheet, inView: () => string[]) {
  const latest = useRef(inView);
  latest.current = inView;
  useEffect(() => {
    const timers = new Set<ReturnType<typeof setTimeout>>();
    let known = events.peek().at(-1);
    const end = effect(() => {
      const all = events.value;
      const young = all.slice(known ? all.lastIndexOf(known) + 1 : 0);
      known = all.at(-1);
      if (!young.some((one) => isStopOf(one, sheet.motor))) return;
      timers.forEach(clearTimeout);
      timers.clear();
      for (const ms of AFTER_STOP) {
        timers.add(setTimeout(() => void read(sheet, latest.current()).catch(() => {}), ms));
      }
    });
    return () => {
      end();
      timers.forEach(clearTimeout);
    };
  }, [sheet]);
}

/** Reads registers once when they come into view. */
function useRowsInView(sheet: Sheet, registers: readonly Register[], shown: readonly Register[]) {
  const body = useRef<HTMLTableElement>(null);
  const visible = useRef(new Set<string>());
  const readable = useMemo(
    () => new Set(registers.filter((register) => register.readable).map(({ name }) => name)),
    [registers],
  );
  const names = shown.map(({ name }) => name).join(' ');
  const inView = () => [...visible.current].filter((name) => readable.has(name));
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    let isWanted = true;
    const readNew = () => {
      const unread = inView().filter((name) => !sheet.cells.value.has(name));
      // A failure is said when one asks for values. The rows then have none.
      if (welcome.value) read(sheet, unread, () => isWanted).catch(() => {});
    };
    const observer = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        const name = (target as HTMLElement).dataset.name!;
        if (isIntersecting) visible.current.add(name);
        else visible.current.delete(name);
      }
      clearTimeout(timer);
      timer = setTimeout(readNew, REST);
    });
    visible.current.clear();
    body.current?.querySelectorAll('tr[data-name]').forEach((row) => observer.observe(row));
    return () => {
      isWanted = false;
      clearTimeout(timer);
      observer.disconnect();
    };
  }, [sheet, names, welcome.value?.run]);
  return { body, inView };
}
