// A step that is applied to a motor: go to the start, wait until it is steady, step, record, end.
import type { AnswerTo, Ask, Rows } from '../link';
import type { Controlled, Description, Event as DriveEvent, MotorName, Register, SignalName } from '../wire';
import { deviation, mean, median, scatter } from './analysis';
import type { Gain, Run } from './run';

export interface Plan {
  motor: MotorName;
  description: Description;
  controlled: Controlled;
  from: number;
  to: number;
  /** How long the response is recorded, in seconds. */
  duration: number;
  /** How fast the motor goes to `from`, in units a second. Of a position: the speed of all moves. */
  approach: number;
  /** What happens at the end. */
  after: 'stop' | 'from';
}

/** What an experiment needs of the page. Times are in seconds. */
export interface Rig {
  ask<A extends Ask>(ask: A): Promise<AnswerTo<A['ask']>>;
  subscribe(signals: SignalName[], period: number, onRows: (rows: Rows) => void, onRefused: (why: Error) => void): () => void;
  /** Stops the motor. Rejects if that is not confirmed. */
  stop(motor: MotorName): Promise<string>;
  /** Events since the page was opened. */
  events(): readonly DriveEvent[];
  /** The name of this page in events. */
  name(): string;
  wait(seconds: number): Promise<void>;
}

/** The highest rate that a share takes. The line carries less; the share says how much. */
const PERIOD = 1e-4;
/** A reference that changes so fast, in steps a second, is there within one message. */
const AT_ONCE = 1e6;
/** Kept before the step. */
const BEFORE = 0.3;
/** Kept while the motor goes to the start. */
const KEPT = 2;
/** A value is steady if it is over this time. */
const STEADY = 0.5;
const STEADY_SAMPLES = 20;
/** Beside noise, a steady value changes by at most this part of the way. */
const STEADY_PART = 0.02;
/** It has to be steady within this time after the reference is there. */
const PATIENCE = 15;
/** The server streams references with this time between them, in seconds, or less. */
const NEXT_REFERENCE = 0.05;
const LOOK = 0.05;
const NO_MORE = 'The motor gives no more values.';

export class Aborted extends Error {}

interface Sample {
  t: number;
  span: number;
  y: number;
}

/** The earliest and the latest time. */
type Interval = [number, number];

/** A step that was asked for. */
interface Applied {
  /** The events before it. */
  known: ReadonlySet<DriveEvent>;
  before: number;
  after: number;
}

/** Gains of all regulators of a motor, and the ramp that it adds itself. */
export function gainsOf({ registers }: Description): Register[] {
  return registers.filter(
    ({ name, readable }) => readable && /^((speed|torque|flux|position)_k[pid](_div)?|acceleration)$/i.test(name),
  );
}

/** The register with the reference of a measured signal, if the drive has one. */
export function referenceOf({ registers }: Description, { measured }: Controlled): string | null {
  const name = measured.replace(/_MEAS$/, '_REF');
  return name !== measured && registers.some((one) => one.name === name && one.readable) ? name : null;
}

export class Experiment {
  private samples: Sample[] = [];
  /** The reference that the drive reports. It may be read in other exchanges. */
  private references: Sample[] = [];
  private lost = 0;
  private isRecording = false;
  private refused: Error | null = null;
  private aborted: Aborted | null = null;
  private onAbort: (why: Aborted) => void = () => {};
  /** Whether the motor may turn because of this experiment. */
  isMoving = false;

  constructor(
    readonly plan: Plan,
    private readonly rig: Rig,
    private readonly onProgress: (text: string) => void,
  ) {}

  /** How many samples were received. */
  get count(): number {
    return this.samples.length;
  }

  /** Ends the experiment. `run` rejects once the motor is stopped. */
  abort(why: string) {
    if (this.aborted) return;
    this.aborted = new Aborted(why);
    this.onAbort(this.aborted);
  }

  /** Applies the step. Whatever fails, the motor is stopped before this rejects. */
  async run(): Promise<Omit<Run, 'number' | 'analysis' | 'isThinned'>> {
    const { motor, description, controlled } = this.plan;
    const reference = referenceOf(description, controlled);
    const signals = [controlled.measured, ...(reference ? [reference] : [])];
    let end = () => {};
    try {
      this.onProgress('Reading the gains.');
      const gains = await this.gains();
      end = this.rig.subscribe(
        signals.map((name) => ({ ...motor, name })), PERIOD, (rows) => this.take(rows, reference),
        (why) => (this.refused = why),
      );
      await this.approach();
      const step = await this.step();
      this.onProgress(`Recording for ${this.plan.duration} s.`);
      const carried = await this.carried();
      const { duration } = this.plan;
      await this.until(() => this.last!.t >= step.after + duration, duration + 5, NO_MORE);
      end();
      this.checkDoubts(step);
      const at = this.when(step);
      await this.end();
      return this.recorded(at, gains, reference, carried);
    } catch (why) {
      end();
      throw await this.fail(why);
    }
  }

  private async gains(): Promise<Gain[]> {
    const registers = gainsOf(this.plan.description);
    const names = registers.map(({ name }) => name);
    if (!names.length) return [];
    const { values } = await this.unlessAborted(this.rig.ask({ ask: 'read', ...this.plan.motor, names }));
    return values
      .filter(({ value }) => value !== null)
      .map(({ name, text }) => ({ name, text, unit: registers.find((one) => one.name === name)?.unit ?? '' }));
  }

  private take({ columns, t0, t, span, values, lost }: Rows, reference: string | null) {
    this.lost += lost;
    const append = (samples: Sample[], name: string | null): Sample[] => {
      const column = values[columns.findIndex((one) => one.name === name)];
      if (!column) return samples;
      for (let row = 0; row < t.length; row += 1) {
        samples.push({ t: t0 + t[row]!, span: span[row]!, y: column[row]! });
      }
      // A fast line gives more than 10 000 samples a second while the motor goes to the start.
      const old = samples.at(-1)!.t - KEPT;
      return !this.isRecording && samples[0]!.t < old - KEPT ? since(samples, old) : samples;
    };
    this.samples = append(this.samples, this.plan.controlled.measured);
    this.references = append(this.references, reference);
  }

  private get last(): Sample | undefined {
    return this.samples.at(-1);
  }

  private async approach() {
    const { from, to, approach } = this.plan;
    await this.until(() => this.samples.length > 2, 10, 'The motor gives no values.');
    let duration = 0;
    // A motor at rest is at 0 without a command. Starting it for that may need a rev-up.
    const isAtRest = from === 0 && this.plan.controlled.mode !== 'position' && this.samples.every(({ y }) => y === 0);
    if (!isAtRest) {
      this.onProgress(`Going to ${from} ${this.plan.controlled.unit}.`);
      const began = await this.command(from, approach);
      duration = Math.abs(from - began) / approach;
      await this.pause(duration);
    }
    this.onProgress('Waiting until the value is steady.');
    const arrived = this.last?.t ?? 0;
    const tolerance = STEADY_PART * Math.abs(to - from);
    const isSteady = () => {
      const now = this.last?.t ?? 0;
      if (now - arrived < STEADY) return false;
      const all = since(this.samples, now - STEADY).map(({ y }) => y).filter((y) => !Number.isNaN(y));
      if (all.length < STEADY_SAMPLES) return false;
      const half = all.length >> 1;
      const noise = scatter(all);
      const drift = Math.abs(mean(all.slice(half)) - mean(all.slice(0, half)));
      return drift <= tolerance + (3 * noise) / Math.sqrt(half) && deviation(all) <= tolerance + 2 * noise;
    };
    await this.until(isSteady, PATIENCE, `The value is not steady ${PATIENCE} s after the motor went to ${from}.`);
  }

  /** Changes the reference at once. Returns the samples just before and after. */
  private async step(): Promise<Applied> {
    const { to, from, approach, controlled } = this.plan;
    // Enough for the record before the step.
    const steady = this.last!.t;
    await this.until(() => this.last!.t >= steady + BEFORE, BEFORE + 5, NO_MORE);
    this.checkStart(since(this.samples, steady));
    this.onProgress('Applying the step.');
    this.isRecording = true;
    const known = new Set(this.rig.events());
    const before = this.last!;
    await this.command(to, controlled.mode === 'position' ? approach : Math.abs(to - from) * AT_ONCE);
    await this.until(() => this.last!.t > before.t, 5, NO_MORE);
    return { known, before: before.t, after: this.last!.t + NEXT_REFERENCE };
  }

  /**
   * A motor that stopped on the way, after a fault or a loss of its power, is steady, too. The step would start
   * it again. The current of a motor that turns freely need not be the reference.
   */
  private checkStart(samples: readonly Sample[]) {
    const { from, to, controlled } = this.plan;
    if (controlled.mode === 'torque' || from === 0) return;
    const measured = mean(samples.map(({ y }) => y).filter((y) => !Number.isNaN(y)));
    if (Math.abs(measured - from) <= Math.abs(from) / 2 + STEADY_PART * Math.abs(to - from)) return;
    throw new Error(`The motor is at ${measured.toFixed(1)} ${controlled.unit}, not at ${from}: it may have lost its power.`);
  }

  /** On a bad line, replies that came twice or late answer other requests. `later`: events were lost. */
  private checkDoubts({ known }: Applied) {
    const { line, motor } = this.plan.motor;
    const doubt = this.rig
      .events()
      .filter((one) => ['doubtful', 'later'].includes(one.event) && !known.has(one))
      .find((one) => (one.line ?? line) === line && (one.motor ?? motor) === motor);
    if (doubt) throw new Error(`The record is not used: ${doubt.message}. Repeat the step.`);
  }

  /** When the reference changed, by the clock of the line. */
  private when({ known, before, after }: Applied): Interval {
    const { motor, description, from, to } = this.plan;
    const isOwn = ({ by }: DriveEvent) => by === this.rig.name() || !!by?.startsWith(`${this.rig.name()} (`);
    const sent = this.rig
      .events()
      .filter(
        (event) =>
          event.event === 'commanded' && event.line === motor.line && event.motor === motor.motor && isOwn(event) &&
          typeof event.t === 'number' && !known.has(event),
      )
      .map(({ t }) => t!);
    const span = median(this.samples.filter(({ t }) => t >= before && t <= after).map((one) => one.span));
    if (!sent.length) return narrowed([before, after], this.references, from, to);
    const last = Math.max(...sent);
    // An RMD motor first gets the measured value as reference, then that of the step. An ST drive first gets
    // the reference, then START_MOTOR.
    if (description.protocol === 'rmd') return [last, last + span];
    return narrowed([Math.min(...sent), last + span], this.references, from, to);
  }

  /** The time between two values that the line carries, as the share says. */
  private async carried(): Promise<number | null> {
    const { motor, controlled } = this.plan;
    const { rates } = await this.unlessAborted(this.rig.ask({ ask: 'rates' }));
    const rate = rates.find(
      ({ line, motor: number, name }) => line === motor.line && number === motor.motor && name === controlled.measured,
    );
    return rate?.predicted ?? null;
  }

  private async end() {
    const { after, from, approach, motor, controlled } = this.plan;
    if (after === 'stop') {
      this.onProgress('Stopping.');
      await this.rig.stop(motor);
      this.isMoving = false;
      return;
    }
    this.onProgress(`Going back to ${from} ${controlled.unit}.`);
    await this.command(from, approach);
  }

  private recorded(
    [earliest, latest]: Interval, gains: Gain[], reference: string | null, carried: number | null,
  ): Omit<Run, 'number' | 'analysis' | 'isThinned'> {
    const { motor, controlled, from, to, duration, description } = this.plan;
    const at = (earliest + latest) / 2;
    const kept = this.samples.filter(({ t }) => t > earliest - BEFORE - STEADY && t < latest + duration);
    const orNull = (value: number) => (Number.isNaN(value) ? null : value);
    return {
      when: Date.now(), motor, mode: controlled.mode, unit: controlled.unit, measured: controlled.measured, from, to,
      t: kept.map(({ t }) => Number((t - at).toFixed(7))),
      y: kept.map(({ y }) => orNull(y)),
      reference: reference ? held(this.references, kept).map(orNull) : null,
      doubt: (latest - earliest) / 2,
      resolution: description.registers.find(({ name }) => name === controlled.measured)?.range?.[2] ?? 0,
      gains,
      carried,
      lost: this.lost,
      ramp: rampText(this.plan, gains),
    };
  }

  /** Moves the reference. Returns the measured value that it began with. */
  private async command(target: number, rate: number): Promise<number> {
    const { motor, controlled } = this.plan;
    this.isMoving = true;
    const run = this.rig.ask({ ask: 'run', ...motor, mode: controlled.mode, target, rate, hold: false });
    return (await this.unlessAborted(run)).from;
  }

  /** Stops the motor, and gives the reason with what is known of the stop. */
  private async fail(why: unknown): Promise<Error> {
    const message = why instanceof Error ? why.message : String(why);
    let stopped = 'Nothing was moved.';
    if (this.isMoving) {
      try {
        stopped = await this.rig.stop(this.plan.motor);
        this.isMoving = false;
      } catch (failure) {
        stopped = `The stop is not confirmed: ${failure instanceof Error ? failure.message : String(failure)}`;
      }
    }
    const text = `${/[.!?]$/.test(message) ? message : `${message}.`} ${stopped}`;
    return why instanceof Aborted ? new Aborted(`Aborted. ${text}`) : new Error(text);
  }

  private async until(is: () => boolean, patience: number, why: string) {
    for (let waited = 0; ; waited += LOOK) {
      if (this.refused) throw this.refused;
      if (is()) return;
      if (waited > patience) throw new Error(why);
      await this.pause(LOOK);
    }
  }

  private pause(seconds: number): Promise<void> {
    return this.unlessAborted(this.rig.wait(seconds));
  }

  private unlessAborted<T>(what: Promise<T>): Promise<T> {
    return new Promise((done, failed) => {
      this.onAbort = failed;
      if (this.aborted) failed(this.aborted);
      what.then(done, failed);
    });
  }
}

/** The last of the references at the time of each sample. */
function held(references: readonly Sample[], samples: readonly Sample[]): number[] {
  let next = 0;
  return samples.map(({ t }) => {
    while (next < references.length && references[next]!.t <= t) next += 1;
    return references[next - 1]?.y ?? NaN;
  });
}

/** The samples after a time. */
function since(samples: Sample[], t: number): Sample[] {
  return samples.slice(samples.findLastIndex((one) => one.t <= t) + 1);
}

/** The reference that the drive reports narrows down when it changed. */
function narrowed([earliest, latest]: Interval, samples: readonly Sample[], from: number, to: number): Interval {
  const changed = samples.findIndex(
    ({ t, span, y }) => t + span / 2 >= earliest && Math.abs(y - to) < Math.abs(y - from),
  );
  const [old, young] = [samples[changed - 1], samples[changed]];
  if (!old || !young) return [earliest, latest];
  const low = Math.max(earliest, old.t - old.span / 2);
  const high = Math.min(latest, young.t + young.span / 2);
  return low <= high ? [low, high] : [earliest, latest];
}

/** What the drive itself does with a reference that changes at once. */
export function rampText({ controlled, approach }: Plan, gains: readonly Gain[]): string {
  if (controlled.mode === 'position') return `The drive plans the move, at most ${approach} ${controlled.unit}/s fast.`;
  const limit = gains.find(({ name }) => /^acceleration$/i.test(name));
  if (!limit) return 'The reference changes at once. No ramp of the drive is known.';
  return Number.parseFloat(limit.text) === 0
    ? 'The reference changes at once. The acceleration of the drive has no limit.'
    : `The drive limits the acceleration to ${limit.text} ${limit.unit}.`;
}
