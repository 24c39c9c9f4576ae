// Step response: apply a step to a motor, record, and say what the response is like.
import { type Signal, signal, useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { descriptions } from '../drives';
import { nameOf, number, tooOld } from '../format';
import { age, latchedBy, state, subscribe, wallAt, welcome } from '../link';
import { Said, type Sentence, useSaid } from '../parts';
import { numberOf } from '../registers/model';
import { MotorPicker } from '../registers/picker';
import { chosen } from '../registers/values';
import { DEFINITIONS, type FigureName } from '../step/analysis';
import { Experiment, type Plan, referenceOf } from '../step/experiment';
import { rig, watch } from '../step/rig';
import { add, figureText, type Run, unitOf } from '../step/run';
import { stopMotor } from '../stop';
import type { Controlled, Description, MotorName } from '../wire';
import { Runs } from './step-runs';
import './step.css';

export default function Step() {
  const motor = chosen.value;
  const description = motor && descriptions.value.get(motor.line);
  const isBusy = useSignal(false);
  return (
    <div class="step">
      <div class="bar">
        <h2>Step response</h2>
        <MotorPicker disabled={isBusy.value} />
      </div>
      {motor && description ? (
        <Setup
          key={nameOf(motor.line, motor.motor)}
          motor={motor}
          description={description}
          onBusy={(is) => (isBusy.value = is)}
        />
      ) : (
        <p class="muted">Waiting for a motor and what it can do …</p>
      )}
      <Runs />
    </div>
  );
}

interface Form {
  mode: string;
  from: string;
  to: string;
  approach: string;
  duration: string;
  after: Plan['after'];
}

const EMPTY: Form = { mode: '', from: '', to: '', approach: '', duration: '2', after: 'stop' };
/** What was entered, by motor: it stays when the view is left. */
const forms = new Map<string, Signal<Form>>();

function formOf(name: string, mode: string): Signal<Form> {
  const form = forms.get(name) ?? signal({ ...EMPTY, mode });
  forms.set(name, form);
  return form;
}

const DURATION = { range: [0.2, 20, 0] as const, unit: 's' };

function Setup({
  motor, description, onBusy,
}: {
  motor: MotorName;
  description: Description;
  onBusy: (is: boolean) => void;
}) {
  const form = formOf(nameOf(motor.line, motor.motor), description.modes[0]?.mode ?? '');
  const progress = useSignal<{ text: string; count: number } | null>(null);
  const running = useRef<Experiment | null>(null);
  /** Whether the motor keeps turning at the start of the step, after the run. */
  const isTurning = useSignal(false);
  const { said, attempt } = useSaid();
  /** What came of the last run. It stays when all motors are stopped: that ends a run. */
  const result = useSignal<Sentence | null>(null);
  const controlled = description.modes.find(({ mode }) => mode === form.value.mode);

  useEffect(
    () => () => {
      running.current?.abort('The view was left.');
      if (isTurning.peek()) void stopMotor(motor.line, motor.motor).catch(() => {});
    },
    [],
  );

  if (!controlled) return <p class="note warn">This drive has nothing that a step can be applied to.</p>;
  const parsed = planOf(form.value, { motor, description, controlled });
  const set = (more: Partial<Form>) => (form.value = { ...form.value, ...more });
  const isBusy = progress.value !== null;
  const refusal = whyNot();

  const start = async (plan: Plan) => {
    if (running.current) return;
    result.value = null;
    const experiment = new Experiment(plan, rig, (text) => {
      progress.value = { text, count: experiment.count };
    });
    running.current = experiment;
    isTurning.value = false;
    onBusy(true);
    progress.value = { text: 'Beginning.', count: 0 };
    const timer = setInterval(() => {
      if (progress.value) progress.value = { ...progress.value, count: experiment.count };
    }, 500);
    const unwatch = watch(motor, (why) => experiment.abort(why));
    try {
      const run = add(await experiment.run());
      result.value = { tone: 'ok', text: `${summary(run)} ${ending(plan)}` };
    } catch (why) {
      result.value = { tone: 'bad', text: (why as Error).message };
    } finally {
      unwatch();
      clearInterval(timer);
      isTurning.value = experiment.isMoving;
      running.current = null;
      progress.value = null;
      onBusy(false);
    }
  };

  return (
    <section aria-label="Set up a step">
      <form
        onSubmit={(event) => {
          event.preventDefault();
          if ('plan' in parsed && refusal === null) void start(parsed.plan);
        }}
      >
        <fieldset disabled={isBusy} class="setup">
          <label class="labelled">
            <span>What</span>
            <select value={form.value.mode} onChange={({ currentTarget }) => set({ mode: currentTarget.value })}>
              {description.modes.map(({ mode, unit }) => (
                <option key={mode} value={mode}>
                  {mode} ({unit})
                </option>
              ))}
            </select>
          </label>
          <Field label={`From (${controlled.unit})`} value={form.value.from} onInput={(from) => set({ from })} />
          <Field label={`To (${controlled.unit})`} value={form.value.to} onInput={(to) => set({ to })} />
          <Field
            label={controlled.mode === 'position' ? `Speed of the moves (${controlled.unit}/s)` : `Change on the way to the start (${controlled.unit}/s)`}
            value={form.value.approach}
            placeholder={parsed.approach}
            onInput={(approach) => set({ approach })}
          />
          <Field label="Record for (s)" value={form.value.duration} onInput={(duration) => set({ duration })} />
          <fieldset class="after">
            <legend>After the record, the motor</legend>
            <label class="check">
              <input type="radio" name="after" checked={form.value.after === 'stop'} onChange={() => set({ after: 'stop' })} />
              <span>stops</span>
            </label>
            <label class="check">
              <input type="radio" name="after" checked={form.value.after === 'from'} onChange={() => set({ after: 'from' })} />
              <span>goes back to the start, and keeps turning</span>
            </label>
          </fieldset>
        </fieldset>
        <Now motor={motor} controlled={controlled} isBusy={isBusy} />
        <div class="plan" aria-live="polite">
          {'plan' in parsed ? <Explanation plan={parsed.plan} /> : <p class="muted">{parsed.why}</p>}
        </div>
        <div class="bar">
          <button type="submit" class="primary" disabled={isBusy || refusal !== null || !('plan' in parsed)}>
            Apply the step
          </button>
          {isBusy && (
            <button type="button" onClick={() => running.current?.abort('You ended it.')}>
              End and stop the motor
            </button>
          )}
          {isTurning.value && !isBusy && (
            <button
              type="button"
              onClick={() =>
                attempt(async () => {
                  const text = await stopMotor(motor.line, motor.motor);
                  isTurning.value = false;
                  return text;
                })
              }
            >
              Stop the motor
            </button>
          )}
          {refusal && <span class="muted">{refusal}</span>}
        </div>
      </form>
      <p role="status" class="progress">
        {progress.value?.text}
      </p>
      {progress.value && <p class="muted count">{progress.value.count} samples</p>}
      <Said said={result.value} />
      <Said said={said} />
    </section>
  );

  function whyNot(): string | null {
    if (welcome.value?.role === 'viewer') return 'A viewer cannot move motors.';
    if (state.value !== 'open') return 'There is no connection.';
    if (latchedBy.value !== null) return 'Motion is refused until the latch is released.';
    return null;
  }
}

function Field({
  label, value, placeholder = '', onInput,
}: {
  label: string;
  value: string;
  placeholder?: string;
  onInput: (text: string) => void;
}) {
  return (
    <label class="labelled">
      <span>{label}</span>
      <input
        inputMode="decimal"
        autocomplete="off"
        value={value}
        placeholder={placeholder}
        onInput={({ currentTarget }) => onInput(currentTarget.value)}
      />
    </label>
  );
}

/** The plan of a form, or what is missing. */
function planOf(
  form: Form,
  { motor, description, controlled }: Pick<Plan, 'motor' | 'description' | 'controlled'>,
): ({ plan: Plan } | { why: string }) & { approach: string } {
  const { unit, most } = controlled;
  const target = { range: [-most, most, 0] as const, unit };
  const [from, to] = [numberOf(form.from, target), numberOf(form.to, target)];
  const usual = 'value' in from && 'value' in to ? Math.max(Math.abs(from.value), Math.abs(to.value)) / 2 : NaN;
  const approach = usual > 0 ? String(Number(usual.toPrecision(2))) : '';
  if ('why' in from) return { why: form.from ? `From: ${from.why}` : 'Enter where the step begins and ends.', approach };
  if ('why' in to) return { why: form.to ? `To: ${to.why}` : 'Enter where the step ends.', approach };
  if (from.value === to.value) return { why: 'The step has no height: both values are the same.', approach };
  const rate = numberOf(form.approach || approach, { range: null, unit });
  if ('why' in rate) return { why: `Rate: ${rate.why}`, approach };
  if (rate.value <= 0) return { why: 'Rate: it has to be above 0.', approach };
  const duration = numberOf(form.duration, DURATION);
  if ('why' in duration) return { why: `Duration: ${duration.why}`, approach };
  const least = controlled.mode === 'position' ? (1.3 * Math.abs(to.value - from.value)) / rate.value : 0;
  if (duration.value < least) return { why: `Record for ${least.toFixed(1)} s or more: so long the move lasts.`, approach };
  return {
    plan: {
      motor, description, controlled, from: from.value, to: to.value, duration: duration.value,
      approach: rate.value, after: form.after,
    },
    approach,
  };
}

/** What will happen, in the order in which it does. */
function Explanation({ plan }: { plan: Plan }) {
  const { motor, controlled, description, from, to, approach, duration, after } = plan;
  const { unit, mode } = controlled;
  const name = nameOf(motor.line, motor.motor);
  const reference = referenceOf(description, controlled);
  return (
    <>
      <p>
        <strong>The motor will turn.</strong> This will happen:
      </p>
      <ol>
        {from === 0 && mode !== 'position' ? (
          <li>
            {name} goes to 0 {unit}, if it is not at rest. A start from rest may include the start procedure of the drive.
          </li>
        ) : (
          <li>
            {name} goes from its measured {mode} to {from} {unit} at {approach} {unit}/s. It is started if it is at rest.
          </li>
        )}
        <li>It waits until {controlled.measured} is steady for half a second.</li>
        <li>
          {mode === 'position'
            ? `It is sent to ${to} ${unit}. The drive plans the move, at most ${approach} ${unit}/s fast.`
            : `The reference changes to ${to} ${unit} at once. A ramp or limit of the drive still applies.`}
          {mode === 'torque' && ' A motor without load then gains speed until the drive limits it.'}
        </li>
        <li>
          {controlled.measured}
          {reference && ` and ${reference}`} {reference ? 'are' : 'is'} recorded for {duration} s, as often as the line
          carries.
        </li>
        <li>
          {after === 'stop'
            ? 'The motor stops.'
            : `The motor goes back to ${from} ${unit}, and keeps turning until you stop it or leave this view.`}
        </li>
      </ol>
      <p class="muted">
        Stop all, leaving this view, hiding the tab or losing the connection ends it and stops the motor.
      </p>
    </>
  );
}

/** The measured value now, to choose the start by. */
function Now({ motor, controlled, isBusy }: { motor: MotorName; controlled: Controlled; isBusy: boolean }) {
  const last = useSignal<{ value: number; wall: number } | null>(null);
  const tick = useSignal(0);
  useEffect(() => {
    last.value = null;
    const end = subscribe(
      [{ ...motor, name: controlled.measured }], 0.2,
      ({ values, t, t0 }) => {
        const row = t.length - 1;
        if (row >= 0) last.value = { value: values[0]![row]!, wall: wallAt(motor.line, t0 + t[row]!) };
      },
      // A step reads faster than the line carries: confirmed rows then come seconds late.
      { rows: !isBusy },
    );
    const timer = setInterval(() => (tick.value += 1), 500);
    return () => {
      end();
      clearInterval(timer);
    };
  }, [motor.line, motor.motor, controlled.measured, isBusy]);
  void tick.value;
  const old = last.value && tooOld(age(last.value.wall));
  return (
    <p class="now">
      {controlled.measured}{' '}
      <output class={old ? 'muted' : undefined} aria-live="off">
        {last.value && !old ? number(last.value.value, controlled.unit === 'A' ? 2 : 0) : '–'}
      </output>{' '}
      {controlled.unit} {old && <span class="muted">(last value: {old})</span>}
    </p>
  );
}

/** What the motor does after the record. */
const ending = ({ after, from, controlled: { unit } }: Plan): string =>
  after === 'stop' ? 'The motor has stopped.' : `The motor goes back to ${from} ${unit}, and turns on.`;

function summary(run: Run): string {
  const names: FigureName[] = ['rise', 'overshoot', 'settling2'];
  const figures = names.map((name) => {
    const figure = run.analysis.figures[name];
    return `${DEFINITIONS[name].name}: ${figureText(figure, unitOf(name, run))}`;
  });
  const first = run.analysis.figures.rise;
  const why = first.kind === 'none' ? ` ${first.why}` : '';
  return `Run ${run.number} is recorded. ${figures.join('; ')}.${why}`;
}
