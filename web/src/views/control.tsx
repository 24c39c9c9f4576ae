// The controls of a motor: start, stop, faults, a reference with its ramp and limit, hold-to-run.
import { useSignal, useSignalEffect } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { afterAcknowledge } from '../acknowledge';
import { COMMANDS, limitName, limits, setLimit } from '../drives';
import { decimalsOf, nameOf, number } from '../format';
import { holdToRun } from '../hold';
import { ask, held, lapsed, welcome } from '../link';
import { useMotion } from '../motion';
import { liveOf } from '../overview';
import { Said, type Sentence, useSaid } from '../parts';
import { checkLatch, stopMotor } from '../stop';
import type { Controlled, Description, Mode } from '../wire';
import { Commands } from './commands';
import { Faults } from './values';

const TITLES: Readonly<Record<Mode, string>> = { speed: 'Speed', torque: 'Torque', position: 'Position' };

/** Where sliders end without a limit, and ramps begin: small, whatever the motor is. By unit. */
const USUAL: Readonly<Record<string, { span: number; rate: number }>> = {
  rpm: { span: 3000, rate: 500 },
  '°/s': { span: 720, rate: 180 },
  '°': { span: 360, rate: 90 },
  A: { span: 2, rate: 0.5 },
  s16A: { span: 4000, rate: 2000 },
};
const OTHER = { span: 100, rate: 10 };

const usual = (unit: string) => USUAL[unit] ?? OTHER;

/** A number that a person typed, or an error that says which field has none. */
function numberOf(text: string, field: string): number {
  const value = Number(text.replace(',', '.'));
  if (text.trim() === '' || !Number.isFinite(value)) throw new Error(`${field}: give a number.`);
  return value;
}

/** What a person entered for a motor. It stays while another view is shown. */
interface Kept {
  mode?: Mode;
  isHold?: boolean;
  fields: Map<Mode, { target: string | null; rate: string }>;
}

const allKept = new Map<string, Kept>();

function keptOf(line: string, motor: number): Kept {
  const name = nameOf(line, motor);
  const kept = allKept.get(name) ?? { fields: new Map() };
  allKept.set(name, kept);
  return kept;
}

interface Props {
  line: string;
  motor: number;
  description: Description;
}

export function Control({ line, motor, description }: Props) {
  const { said, attempt, say, isBusy } = useSaid();
  const role = welcome.value?.role;
  const isViewer = role === 'viewer';
  const mayMove = role === 'operator';
  const kept = keptOf(line, motor);
  const chosen = useSignal<Mode>(kept.mode ?? description.modes[0]?.mode ?? 'speed');
  const isHold = useSignal(kept.isHold ?? false);
  useSignalEffect(() => {
    kept.mode = chosen.value;
    kept.isHold = isHold.value;
  });
  const mode = description.modes.find((one) => one.mode === chosen.value);
  const { start, title, hint, acknowledge } = COMMANDS[description.protocol];
  const has = (name: string) => description.commands.some((command) => command.name === name);
  const why = isViewer ? 'viewer' : undefined;

  const act = (command: string, done: () => string | Promise<Sentence>) =>
    attempt(async () => {
      lapsed.value = null;
      if (command === start) checkLatch();
      await ask({ ask: 'act', line, motor, command, values: {}, hold: false });
      return done();
    });

  return (
    <div class="control">
      <div class="buttons">
        <button
          type="button"
          disabled={!mayMove || isHold.value || !has(start)}
          aria-describedby={why}
          title={hint}
          onClick={() => act(start, () => `${title}: the drive acknowledged it.`)}
        >
          {title}
        </button>
        <button type="button" class="stop" onClick={() => attempt(() => stopMotor(line, motor))}>
          Stop
        </button>
        {has(acknowledge) && (
          <button
            type="button"
            disabled={!mayMove}
            aria-describedby={why}
            onClick={() => act(acknowledge, () => afterAcknowledge(line, motor))}
          >
            Acknowledge faults
          </button>
        )}
      </div>
      <Said said={said} />
      <Faults line={line} motor={motor} description={description} />
      <div class="modes">
        <fieldset disabled={isBusy}>
          <legend class="hidden">Mode of {nameOf(line, motor)}</legend>
          {description.modes.map((one) => (
            <label key={one.mode}>
              <input
                type="radio"
                name={`mode-${line}-${motor}`}
                checked={one.mode === chosen.value}
                onChange={() => (chosen.value = one.mode)}
              />
              {TITLES[one.mode]}
            </label>
          ))}
        </fieldset>
        <label class="switch">
          <input
            type="checkbox"
            role="switch"
            checked={isHold.value}
            disabled={!mayMove}
            aria-describedby={why}
            onChange={({ currentTarget }) => (isHold.value = currentTarget.checked)}
          />
          Hold to run
        </label>
      </div>
      {mode && (
        <Reference
          key={mode.mode}
          line={line}
          motor={motor}
          mode={mode}
          description={description}
          isHold={isHold.value}
          mayMove={mayMove}
          why={why}
          onRun={() => say(null)}
        />
      )}
      {description.commands.length > 0 && (
        <Commands line={line} motor={motor} commands={description.commands} isHold={isHold.value} mayMove={mayMove} />
      )}
    </div>
  );
}

/** The unit of the rate. That of a position is a speed. */
function rateUnit({ mode, unit }: Controlled, { modes }: Description): string {
  if (mode === 'position') return modes.find((one) => one.mode === 'speed')?.unit ?? `${unit}/s`;
  return unit.endsWith('/s') ? `${unit}²` : `${unit}/s`;
}

interface ReferenceProps {
  line: string;
  motor: number;
  mode: Controlled;
  description: Description;
  isHold: boolean;
  mayMove: boolean;
  why: string | undefined;
  onRun: () => void;
}

function Reference({ line, motor, mode: controlled, description, isHold, mayMove, why, onRun }: ReferenceProps) {
  const { mode, unit, measured, most } = controlled;
  const { said, attempt, say, isBusy } = useSaid();
  const motion = useMotion(line, motor, description, unit, say);
  const decimals = decimalsOf(unit);
  const kept = keptOf(line, motor).fields;
  /** What was typed. `null`: the first motion is none. */
  const target = useSignal<string | null>(kept.get(mode)?.target ?? null);
  const rate = useSignal(kept.get(mode)?.rate ?? String(usual(unit).rate));
  const limit = limits.value?.get(limitName(line, motor, mode));
  const newLimit = useSignal('');
  const isHeld = useSignal(false);

  // The reference begins at the measured value: the first motion is none.
  const live = liveOf(line, motor);
  const isWaiting = target.value === null;
  const first = isWaiting ? live.values.get(measured) : undefined;
  if (isWaiting) void live.tick.value;
  useEffect(() => {
    if (target.value === null && first && Number.isFinite(first.value) && live.age(measured) < 1) {
      target.value = first.value.toFixed(decimals);
    }
  }, [first]);

  const rateLabel = mode === 'position' ? 'Speed' : 'Ramp';
  const span = Math.min(limit ?? usual(unit).span, most);
  const run = async (hold: boolean) => {
    motion.forget();
    lapsed.value = null;
    checkLatch();
    onRun();
    const to = numberOf(target.value ?? '', 'Target');
    const perSecond = numberOf(rate.value, rateLabel);
    const { from, streams } = await ask({ ask: 'run', line, motor, mode, target: to, rate: perSecond, hold });
    if (streams) motion.begin();
    else motion.beginAlone(Math.abs(to - from) / perSecond, `${number(to, decimals)} ${unit}`);
    return `Running from ${number(from, decimals)} ${unit}.`;
  };
  // The answer may come after the release. What it started then has to stop.
  const runHeld = async () => {
    const text = await run(true);
    if (held.value) return text;
    motion.forget();
    return stopMotor(line, motor);
  };

  const button = useRef<HTMLButtonElement>(null);
  const latest = useRef({ runHeld, attempt, motion });
  latest.current = { runHeld, attempt, motion };
  useEffect(() => {
    if (!isHold || !mayMove || !button.current) return;
    return holdToRun(
      button.current,
      () => {
        isHeld.value = true;
        void latest.current.attempt(latest.current.runHeld);
      },
      () => {
        isHeld.value = false;
        latest.current.motion.forget();
        void latest.current.attempt(() => stopMotor(line, motor));
      },
    );
  }, [isHold, mayMove]);

  const step = 10 ** -decimals;
  const typed = (signal: { value: string | null }) => (event: { currentTarget: HTMLInputElement }) => {
    signal.value = event.currentTarget.value;
    kept.set(mode, { target: target.value, rate: rate.value });
  };
  const none = limits.value ? 'none set' : 'unknown';
  const limitText = limit === undefined ? none : `±${number(limit, decimals)} ${unit}`;
  const saveLimit = (wanted: () => number | null) =>
    attempt(async () => {
      const value = wanted();
      await setLimit(line, motor, mode, value);
      newLimit.value = '';
      return value === null ? 'There is no limit now.' : 'The limit holds for all pages.';
    });
  return (
    <form
      class="fields"
      onSubmit={(event) => {
        event.preventDefault();
        if (!isHold && mayMove) void attempt(() => run(false));
      }}
    >
      <label class="wide">
        Target: −{number(span, decimals)} to {number(span, decimals)} {unit}
        <input
          type="range"
          min={-span}
          max={span}
          step={step}
          value={target.value ?? '0'}
          disabled={!mayMove || isWaiting}
          aria-describedby={why}
          aria-label={`Target, slider, ${unit}`}
          onInput={typed(target)}
        />
      </label>
      <label>
        Target, {unit}
        <input
          type="number"
          step="any"
          value={target.value ?? ''}
          disabled={!mayMove || isWaiting}
          aria-describedby={why}
          onInput={typed(target)}
        />
      </label>
      <label>
        {rateLabel}, {rateUnit(controlled, description)}
        <input type="number" step="any" min="0" value={rate.value} disabled={!mayMove} onInput={typed(rate)} />
      </label>
      {isHold ? (
        <button
          type="button"
          ref={button}
          class="wide primary hold"
          disabled={!mayMove || isWaiting}
          data-held={isHeld.value ? '' : undefined}
          aria-pressed={isHeld.value}
          aria-keyshortcuts="H Enter"
        >
          {isHeld.value ? 'Running: let go to stop' : 'Hold to run'}
        </button>
      ) : (
        <button type="submit" class="wide primary" disabled={!mayMove || isWaiting || isBusy} aria-describedby={why}>
          Run to target
        </button>
      )}
      <Said said={said} />
      <div class="wide field">
        <label for={`limit-${line}-${motor}-${mode}`}>
          Limit of all pages for the target {mode}: {limitText}
        </label>
        <span class="with-button">
          <input
            id={`limit-${line}-${motor}-${mode}`}
            type="number"
            step="any"
            min="0"
            placeholder={limit === undefined ? `at most, ${unit}` : String(limit)}
            value={newLimit.value}
            disabled={!mayMove}
            onInput={typed(newLimit)}
          />
          <button
            type="button"
            disabled={!mayMove}
            onClick={() => saveLimit(() => numberOf(newLimit.value, 'Limit'))}
          >
            Set limit
          </button>
          <button type="button" disabled={!mayMove || limit === undefined} onClick={() => saveLimit(() => null)}>
            No limit
          </button>
        </span>
      </div>
    </form>
  );
}
