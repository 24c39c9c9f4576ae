// Simulated drives and a monitor for each test, as processes that the test can end, freeze and cut off.
import { test as base, expect, type Page } from '@playwright/test';
import { type ChildProcess, spawn } from 'node:child_process';
import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { createInterface } from 'node:readline';

const PROGRAM = resolve(process.env.MOTORLINK_BIN ?? '../target/debug/motorlink');

/** A process that prints a JSON object per line. */
export class Program {
  readonly lines: Record<string, unknown>[] = [];
  readonly process: ChildProcess;
  stderr = '';
  private wakes: (() => void)[] = [];

  constructor(args: string[], cwd: string) {
    this.process = spawn(PROGRAM, args, { cwd, stdio: ['pipe', 'pipe', 'pipe'] });
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

interface Port {
  protocol: string;
  motors: Record<string, unknown>[];
}

/** Simulated drives on ports: an ST drive with two motors, RMD motors 1 to 4. */
export class Bench {
  readonly folder = mkdtempSync(join(tmpdir(), 'motorlink-'));
  drives!: Program;
  monitor!: Program;
  url!: string;
  viewerUrl!: string;

  async plug() {
    this.drives = new Program(
      ['sim', '--st', `pty:${this.folder}/st0`, '--rmd', `slcan-pty:${this.folder}/can0`, '--stdin', '--json'],
      this.folder,
    );
    await this.drives.line((line) => line['protocol'] === 'rmd');
  }

  /** As `plug`, with an ST drive on TCP. Gives its port. */
  async listen() {
    this.drives = new Program(['sim', '--st', 'tcp-listen:127.0.0.1:0', '--stdin', '--json'], this.folder);
    const ready = await this.drives.line((line) => line['protocol'] === 'st');
    return Number(String(ready['path']).split(':').at(-1));
  }

  async serve(ports = ['-p', `${this.folder}/st0`, '-p', `slcan:${this.folder}/can0`]) {
    this.monitor = new Program(
      ['monitor', ...ports, '--timeout', '1s', '--listen', '127.0.0.1:0', '--json'],
      this.folder,
    );
    const ready = await this.monitor.line((line) => line['event'] === 'ready');
    this.url = String(ready['url']);
    this.viewerUrl = String(ready['viewer_url']);
  }

  /** What a motor does, from outside of its protocol. */
  async truth(line: 'st' | 'rmd', motor: number) {
    const { state } = (await this.drives.tell({ command: 'state' })) as { state: Port[] };
    const port = state.find((one) => one.protocol === line);
    const found = port?.motors.find((one) => one['motor'] === motor);
    if (!found) throw new Error(`no motor ${motor} in ${JSON.stringify(state)}`);
    return found;
  }

  /** Its speed, rpm or °/s. */
  async speed(line: 'st' | 'rmd', motor: number) {
    const truth = await this.truth(line, motor);
    return Number(truth[line === 'st' ? 'speed_rpm' : 'speed_dps']);
  }

  async end() {
    const code = await this.monitor.end();
    await this.drives.end();
    rmSync(this.folder, { recursive: true, force: true });
    return code;
  }
}

export const test = base.extend<{ bench: Bench; live: Page }>({
  bench: async ({}, use) => {
    if (!existsSync(PROGRAM)) throw new Error(`${PROGRAM} is not there: run \`make browser\``);
    const bench = new Bench();
    await bench.plug();
    await bench.serve();
    await use(bench);
    await bench.end();
  },
  /** The page of an operator, connected, with all motors found. */
  live: async ({ bench, page }, use) => {
    await page.goto(bench.url);
    await expect(page.getByRole('article')).toHaveCount(6);
    await use(page);
  },
});

export { expect };
