// 36 simulated motors with 8 signals each at 100 Hz, a monitor, and a recording of all of them.
import { readdirSync, writeFileSync } from 'node:fs';
import { execFileSync } from 'node:child_process';
import { Bench, PROGRAM, Program } from './bench';

export const RATE = 100;
/** An ST drive has two motors, a bus has 16. */
export const LINES = { st: 2, rmd: 2 };
const MOTORS = { st: 2, rmd: 16 };
/** The register that reads the time of the drive, in ms. */
export const CLOCK = 'SPEED_REF';
const SIGNALS = {
  st: ['STATUS', 'FLAGS', CLOCK, 'SPEED_MEAS', 'TORQUE_REF', 'TORQUE_MEAS', 'BUS_VOLTAGE', 'HEATS_TEMP'],
  rmd: [
    'temperature_celsius', 'iq_amps', 'speed_dps', 'encoder', 'multi_turn_angle_degrees', 'voltage_volts', 'errors',
  ],
};

export interface SignalOf {
  line: string;
  motor: number;
  name: string;
}

const numbers = (count: number) => Array.from({ length: count }, (_, index) => index);

/** A signal of all motors of one kind. */
export const ofAll = (kind: 'st' | 'rmd', name: string): SignalOf[] =>
  numbers(LINES[kind]).flatMap((line) =>
    numbers(MOTORS[kind]).map((motor) => ({ line: `${kind}${line}`, motor: motor + 1, name })),
  );

/** What `motorlink info --json` says of a recording, as far as it is needed. */
interface Info {
  messages: number;
  lost_messages: number;
  unconfirmed_rows: number;
  /** It is damaged. */
  lost?: { why: string };
}

interface State {
  motors: { motor: number; speed_rpm: number }[];
}

export class Fleet extends Bench {
  private ports: string[] = [];
  private recorder: Program | undefined;

  override async plug() {
    const config = `${this.folder}/fleet.toml`;
    const motors = numbers(MOTORS.rmd).map((motor) => `[[rmd.motor]]\nid = ${motor + 1}\n`);
    writeFileSync(config, `clock_register = "${CLOCK}"\n${motors.join('')}`);
    const listen = (kind: 'st' | 'rmd') => numbers(LINES[kind]).flatMap(() => [`--${kind}`, 'tcp-listen:127.0.0.1:0']);
    this.drives = new Program(
      ['sim', config, ...listen('st'), ...listen('rmd'), '--stdin', '--json'], this.folder,
    );
    const count = LINES.st + LINES.rmd;
    await this.drives.line(() => this.drives.lines.length >= count);
    this.ports = this.drives.lines.slice(0, count).map(({ port }) => String(port));
    const serial = this.drives.lines.slice(0, count).map(
      ({ protocol, path }) => `${protocol === 'rmd' ? 'slcan:' : ''}tcp:${String(path)}`,
    );
    await this.serve(serial.flatMap((port) => ['-p', port]), '300ms');
  }

  /** Turns all RMD motors of a bus from another program, so that curves move. */
  turn(line: string) {
    const speed = [0xa2, 0, 0, 0, ...new Uint8Array(new Int32Array([36_000]).buffer)];
    this.join(
      ...ofAll('rmd', '').filter((one) => one.line === line).map(({ motor }) =>
        ({ id: motor + 1, ask: 'command', line, motor, bytes: speed, time_to_live: 5 })),
    );
  }

  /** The clock of the drives now: in seconds, never less than it is, and by how much it may be more. */
  async clock() {
    const before = performance.now();
    const { t } = (await this.drives.tell({ command: 'state', port: this.ports[0] })) as { t: number };
    return { t, before, error: performance.now() - before };
  }

  /** The speed of a motor of an ST drive, in rpm. */
  async speedAt(line: number, motor: number) {
    const { state } = (await this.drives.tell({ command: 'state', port: this.ports[line] })) as { state: State[] };
    return state[0]!.motors.find((one) => one.motor === motor)!.speed_rpm;
  }

  /** Records all signals of all motors, until `recorded`. */
  async record() {
    const at = String(this.ready['at']).replace('unix:', '');
    const lines = (['st', 'rmd'] as const).flatMap((kind) => numbers(LINES[kind]).map((line) => `${kind}${line}`));
    this.recorder = new Program(
      [
        'record', ...lines.flatMap((line) => ['-p', `share:${at}/${line}`]), ...SIGNALS.st, ...SIGNALS.rmd,
        '--rate', String(RATE), '--no-settings', '-o', `${this.folder}/all.mcap`, '--json',
      ],
      this.folder,
    );
    await this.recorder.line(() => true);
  }

  /** Ends the recording. What its last line and the file say. */
  async recorded() {
    const code = await this.recorder!.end();
    const last = this.recorder!.lines.at(-1)!;
    return { code, last, info: this.info('all.mcap') };
  }

  /** What is in the recording that a page made. */
  ownRecording() {
    const [file] = readdirSync(`${this.folder}/recordings`);
    return this.info(`recordings/${file}`);
  }

  private info(file: string): Info {
    return JSON.parse(execFileSync(PROGRAM, ['info', '--json', `${this.folder}/${file}`]).toString()) as Info;
  }

  override async end() {
    await this.recorder?.end();
    return super.end();
  }
}
