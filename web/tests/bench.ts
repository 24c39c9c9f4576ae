// Simulated drives and a monitor for each test, as processes that the test can end, freeze and cut off.
import AxeBuilder from '@axe-core/playwright';
import { test as base, expect, type Locator, type Page } from '@playwright/test';
import { type ChildProcess, spawn, type SpawnOptions } from 'node:child_process';
import { connect, type Socket } from 'node:net';
import { existsSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { createInterface } from 'node:readline';

export const PROGRAM = resolve(process.env.MOTORLINK_BIN ?? '../target/debug/motorlink');

/** A process that prints a JSON object per line. */
export class Program {
  readonly lines: Record<string, unknown>[] = [];
  readonly process: ChildProcess;
  stderr = '';
  private wakes: (() => void)[] = [];

  constructor(args: string[], cwd: string) {
    this.process = spawnWithTests(PROGRAM, args, { cwd, stdio: ['pipe', 'pipe', 'pipe'] });
    this.process.stderr!.on('data', (bytes: Buffer) => (this.stderr += bytes.toString()));
    createInterface({ input: this.process.stdout! }).on('line', (line) => {
      this.lines.push(JSON.parse(line) as Record<string, unknown>);
      this.wake();
    });
    this.process.on('exit', () => this.wake());
  }

  private wake() {
    const wakes = this.wakes;
    this.wakes = [];
    for (const wake of wakes) wake();
  }

  get hasEnded() {
    return this.process.exitCode !== null || this.process.signalCode !== null;
  }

  /** The first line from `from` on that `is` wanted. */
  async line(is: (line: Record<string, unknown>) => boolean, from = 0) {
    for (;;) {
      const found = this.lines.slice(from).find(is);
      if (found) return found;
      if (this.hasEnded) throw new Error(`${PROGRAM} has ended: ${this.stderr}`);
      await new Promise<void>((done) => this.wakes.push(done));
    }
  }

  /** Writes a command of `motorlink sim`, and gives its answer. */
  async tell(command: object) {
    const from = this.lines.length;
    this.process.stdin!.write(`${JSON.stringify(command)}\n`);
    return this.line(() => true, from);
  }

  async end(signal: NodeJS.Signals = 'SIGTERM') {
    if (this.hasEnded) return this.process.exitCode;
    const ended = new Promise<number | null>((done) => this.process.on('exit', done));
    this.process.kill(signal);
    this.process.kill('SIGCONT');
    return ended;
  }
}

/** Starts a process that the kernel ends when this one ends, also if it is killed. */
export const spawnWithTests = (program: string, args: string[], options: SpawnOptions): ChildProcess =>
  spawn('setpriv', ['--pdeathsig', 'KILL', '--', program, ...args], options);

/** When the speed of a motor is looked at again, in ms. */
const LOOKS = [50];

/** States of an ST drive on the way to RUN. */
const STARTING = /ALIGN|START|CHARGE|CALIB|CLEAR|SWITCH/;

interface Port {
  motors: Record<string, unknown>[];
}

/** Simulated drives on ports: an ST drive with two motors, RMD motors 1 to 4. */
export class Bench {
  readonly folder = mkdtempSync(join(tmpdir(), 'motorlink-'));
  drives!: Program;
  monitor!: Program;
  ready!: Record<string, unknown>;
  url!: string;
  viewerUrl!: string;
  private others: Socket[] = [];

  async plug() {
    this.drives = new Program(
      ['sim', '--st', `pty:${this.folder}/st0`, '--rmd', `slcan-pty:${this.folder}/can0`, '--stdin', '--json'],
      this.folder,
    );
    await this.drives.line((line) => line['protocol'] === 'rmd');
  }

  /** An ST drive whose torque register reads the time since the start in ms, modulo 2^16. */
  async plugClock() {
    writeFileSync(`${this.folder}/clock.toml`, 'clock_register = "TORQUE_MEAS"\n');
    this.drives = new Program(
      ['sim', `${this.folder}/clock.toml`, '--st', `pty:${this.folder}/st0`, '--stdin', '--json'], this.folder,
    );
    await this.drives.line((line) => line['protocol'] === 'st');
  }

  /** As `plug`, with an ST drive or RMD motors on TCP alone. Gives the port. */
  async listen(protocol: 'st' | 'rmd') {
    const ports = [`--${protocol}`, 'tcp-listen:127.0.0.1:0'];
    this.drives = new Program(['sim', ...ports, '--stdin', '--json'], this.folder);
    const ready = await this.drives.line((line) => line['protocol'] === protocol);
    return Number(String(ready['path']).split(':').at(-1));
  }

  /** The deadline is long, because a loaded machine pauses browsers. */
  async serve(ports = ['-p', `${this.folder}/st0`, '-p', `slcan:${this.folder}/can0`], deadline = '1s') {
    // The timeout of a running share is its own.
    const timeout = ports.includes('--share') ? [] : ['--timeout', '1s'];
    this.monitor = new Program(
      ['monitor', ...ports, ...timeout, '--deadline', deadline, '--listen', '127.0.0.1:0', '--json'],
      this.folder,
    );
    this.ready = await this.monitor.line((line) => line['event'] === 'ready');
    this.url = String(this.ready['url']);
    this.viewerUrl = String(this.ready['viewer_url']);
  }

  /** Turns the first ST motor from another program. */
  start() {
    const command = (id: number, ...bytes: number[]) => ({ id, ask: 'command', line: 'st0', motor: 1, bytes, time_to_live: 10 });
    this.join(
      command(2, 7, 232, 3, 0, 0, 244, 1), // SET_RAMP: to 1000 rpm in 500 ms
      command(3, 3, 1), // EXECUTE_CMD START_MOTOR
    );
  }

  /** What turns the first RMD motor from another program, again and again. */
  starter() {
    const ask = this.join();
    let id = 1;
    const bytes = [0xa2, 0, 0, 0, ...new Uint8Array(new Int32Array([60_000]).buffer)];
    return () => ask({ id: (id += 1), ask: 'command', line: 'rmd0', motor: 1, bytes, time_to_live: 10 });
  }

  /** Reads the speed of the first ST motor from another program. */
  read() {
    const signals = [{ line: 'st0', motor: 1, name: 'SPEED_MEAS' }];
    this.join({ id: 2, ask: 'subscribe', signals, period: 0.02, queue: 100, drop: 'oldest' });
  }

  /** Another program at the share, until the end of the test. Gives what asks for more. */
  join(...requests: object[]) {
    const socket = connect(String(this.ready['at']).replace('unix:', ''));
    this.others.push(socket);
    socket.resume();
    const ask = (request: object) => {
      const text = Buffer.from(JSON.stringify(request));
      const header = Buffer.alloc(8);
      header.writeUInt32LE(text.length);
      header[4] = 1;
      socket.write(Buffer.concat([header, text]));
    };
    for (const request of [{ id: 1, ask: 'hello', protocol: 1, name: 'other' }, ...requests]) ask(request);
    return ask;
  }

  /** What a motor does, from outside of its protocol. */
  async truth(line: 'st' | 'rmd', motor: number) {
    const { state } = (await this.drives.tell({ command: 'state' })) as { state: Port[] };
    const kind = line === 'st' ? 'status' : 'mode';
    const motors = state.flatMap((port) => port.motors);
    const found = motors.find((one) => one['motor'] === motor && kind in one);
    if (!found) throw new Error(`the drives have no motor ${motor}`);
    return found;
  }

  /** Its speed without sign, rpm or °/s. NaN while it starts: the alignment swings the rotor to and fro. */
  async speed(line: 'st' | 'rmd', motor: number) {
    const truth = await this.truth(line, motor);
    if (line === 'rmd') return Math.abs(Number(truth['speed_dps']));
    return STARTING.test(String(truth['status'])) ? NaN : Math.abs(Number(truth['speed_rpm']));
  }

  /** Waits until the first motor of a line turns. */
  turns(line: 'st' | 'rmd' = 'st', message = 'a motor that turns') {
    return expect.poll(() => this.speed(line, 1), { message, intervals: LOOKS }).toBeGreaterThan(TURNS);
  }

  /** Waits until it stands still. */
  rests(line: 'st' | 'rmd' = 'st', message = 'a motor that rests') {
    return expect.poll(() => this.speed(line, 1), { message, intervals: LOOKS }).toBeLessThan(STILL);
  }

  async end() {
    this.others.forEach((socket) => socket.destroy());
    const code = await this.monitor?.end();
    await this.drives?.end();
    rmSync(this.folder, { recursive: true, force: true });
    return code;
  }
}

export const test = base.extend<{ bench: Bench; live: Page; viewer: Page }>({
  bench: async ({}, use) => {
    if (!existsSync(PROGRAM)) throw new Error(`${PROGRAM} is not there: run \`make browser\``);
    const bench = new Bench();
    try {
      await bench.plug();
      await bench.serve();
      await use(bench);
    } finally {
      await bench.end();
    }
  },
  /** The page of an operator, connected, with all motors found. */
  live: async ({ bench, page }, use) => {
    await page.goto(bench.url);
    await expect(page.getByRole('article')).toHaveCount(6);
    await use(page);
  },
  /** The page of a viewer beside it. */
  viewer: async ({ bench, browser }, use) => {
    const context = await browser.newContext();
    const page = await context.newPage();
    await page.goto(bench.viewerUrl);
    await use(page);
    await context.close();
  },
});

/** The views, as the navigation calls them. */
export const VIEWS = ['Motors', 'Plots', 'Registers', 'Step response', 'Wire', 'Recordings', 'Events', 'Ports'];

/** The card of a motor. */
export const card = (page: Page, name: string) => page.getByRole('article', { name: `Motor ${name}` });

/** A motor that turns, faster than what it does at rest, in rpm or °/s. */
export const TURNS = 300;
export const STILL = 5;

/** Whether a motor runs, as its card says. A loaded machine and a motor that still stops refuse: a person tries again. */
async function runs(motor: Locator) {
  const said = motor.locator('form.fields .said').first();
  await expect(said).toHaveText(/^✓ Running|the command is too old|it is still stopping|no sign of life/);
  return (await said.innerText()).startsWith('✓ Running');
}

/** Turns a motor from a page, in rpm or °/s, and waits until the server says that it begins. */
export async function spin(page: Page, speed: number, name = 'st0/1') {
  const motor = card(page, name);
  const unit = name.startsWith('rmd') ? '°/s' : 'rpm';
  await motor.getByRole('spinbutton', { name: `Target, ${unit}` }).fill(String(speed));
  await motor.getByRole('spinbutton', { name: 'Ramp' }).fill('2000');
  do await motor.getByRole('button', { name: 'Run to target' }).click();
  while (!(await runs(motor)));
}

/** Holds a motor from a page, and waits until the server says that it begins. */
export async function hold(motor: Locator, press: () => Promise<void>, release: () => Promise<void>) {
  for (await press(); !(await runs(motor)); await press()) await release();
}

/** Opens a view by its name in the navigation. */
export async function open(page: Page, view: string) {
  await page.getByRole('navigation').getByRole('link', { name: view, exact: true }).click();
  await expect(page.getByRole('heading', { name: view, level: 2 })).toBeVisible();
}

/** What axe finds. It opens no page for frames, as there are none, and tells of nothing else: both take long. */
export async function violations(page: Page) {
  const { violations: found } = await new AxeBuilder({ page }).setLegacyMode().options({ resultTypes: ['violations'] }).analyze();
  return found.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(' ')}`);
}

export { expect };
