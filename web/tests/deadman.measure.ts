// How long a motor keeps turning after what moved it is gone: `make deadman`, docs/BENCHMARKS.md.
import { test } from '@playwright/test';
import type { ChildProcess } from 'node:child_process';
import { resolve } from 'node:path';
import { Bench, Program, spawnWithTests, spin, STILL } from './bench';
import { Chromium } from './chromium';
import { Network, Wire } from './network';
import { type Cell, publish, quantile, row, table } from './report';
import { Stalls } from './stalls';

const RUNS = Number(process.env.RUNS ?? 50);
/** What differs between the protocols, for motor 1. */
const KINDS = {
  // EXECUTE_CMD STOP_MOTOR, without its checksum.
  st: { served: 'pty:', port: '', motor: 'st0/1', speed: 1500, stop: Buffer.from([0x23, 0x01, 0x02]) },
  // Motor stop, in the text of slcan.
  rmd: { served: 'slcan-pty:', port: 'slcan:', motor: 'rmd0/1', speed: 600, stop: Buffer.from('t141881') },
};

/** A control loop that hangs at SIGUSR1, while its process runs. */
const LOOP = `
import signal, sys, time
import motorlink
signal.signal(signal.SIGUSR1, lambda *_: time.sleep(3600))
with motorlink.rmd.open(sys.argv[1], timeout=1) as bus:
    while True:
        bus.motor(1).set_speed(600)
        time.sleep(0.02)
`;

/** What one run has: simulated drives, a wire that is watched, a server, a network, a browser or a program. */
interface World {
  bench: Bench;
  wire: Wire;
  network: Network;
  /** Not with a program. */
  chromium: Chromium | undefined;
  guard: Program | undefined;
  /** What turns the motor instead of a page, and what it is connected to. */
  mover: ChildProcess | undefined;
  hub: Program | undefined;
}

interface Case {
  name: string;
  /** Which program turns an RMD motor there, instead of a page. */
  program?: { at: 'share' | 'node'; loop?: true };
  protocol?: 'st' | 'rmd';
  /** Whether `motorlink guard` is between the server and the drive. */
  guarded?: boolean;
  /** Prepares the event. What it returns makes it happen. */
  event: (world: World) => Promise<() => unknown>;
  /** From when on the time is measured, if not from the event. */
  from?: (world: World) => Promise<number>;
}

const CASES: Case[] = [
  { name: 'page killed (its process)', event: async ({ chromium }) => chromium!.signals('SIGKILL') },
  { name: 'browser killed', event: async ({ chromium }) => () => chromium!.kill() },
  { name: 'tab frozen (SIGSTOP)', event: async ({ chromium }) => chromium!.signals('SIGSTOP') },
  { name: 'network cut', event: async ({ network }) => () => network.set({ cut: 'both' }) },
  { name: 'tab hidden', event: async ({ chromium }) => () => chromium!.tab() },
  {
    name: 'server killed, guard beneath',
    guarded: true,
    event: async ({ bench }) => () => bench.monitor.process.kill('SIGKILL'),
  },
  {
    name: 'server frozen (SIGSTOP), guard with --silence 500ms beneath',
    guarded: true,
    event: async ({ bench }) => () => bench.monitor.process.kill('SIGSTOP'),
  },
  {
    name: 'server killed, guard of RMD motors beneath',
    protocol: 'rmd',
    guarded: true,
    event: async ({ bench }) => () => bench.monitor.process.kill('SIGKILL'),
  },
  {
    name: 'server frozen (SIGSTOP), guard of RMD motors with --silence 500ms beneath',
    protocol: 'rmd',
    guarded: true,
    event: async ({ bench }) => () => bench.monitor.process.kill('SIGSTOP'),
  },
  {
    name: 'drive unplugged for 1 s, page killed meanwhile; from plugged in',
    event: async ({ wire, chromium }) => {
      const kill = await chromium!.signals('SIGKILL');
      return async () => {
        wire.unplug();
        kill();
        await new Promise((done) => setTimeout(done, 1000));
        wire.plug();
      };
    },
    from: async () => performance.now(),
  },
];

/** Programs that hang: in a debugger, stopped, or in their loop. */
const HANGING: Case[] = (['share', 'node'] as const).flatMap((at) => [
  {
    name: `program at a ${at} frozen (SIGSTOP), the usual deadline of ${at === 'share' ? '2 s' : '1 s'}`,
    protocol: 'rmd' as const,
    program: { at },
    event: async ({ mover }: World) => () => mover!.kill('SIGSTOP'),
  },
  {
    name: `Python loop at a ${at} blocked, motion=500ms`,
    protocol: 'rmd' as const,
    program: { at, loop: true as const },
    event: async ({ mover }: World) => () => mover!.kill('SIGUSR1'),
  },
]);

/** A program that turns RMD motor 1 through a share or a node with this port. */
async function programAt({ at, loop }: NonNullable<Case['program']>, serial: string, bench: Bench) {
  const share = `${bench.folder}/share`;
  const words = at === 'node' ? ['--name', 'arm', '--listen', 'tcp/127.0.0.1:0'] : [];
  const hub = new Program([at, '-p', serial, '--at', `unix:${share}`, ...words, '--json'], bench.folder);
  const { addresses } = (await hub.line(() => true)) as { addresses?: string[] };
  const options = [...(loop ? ['motion=500ms'] : []), ...(addresses ? [`via=${addresses[0]}`] : [])].join('&');
  const port = `${at === 'share' ? `share:${share}` : 'zenoh:arm'}/rmd0${options && '?'}${options}`;
  if (loop) {
    const python = resolve(process.env.PYTHON ?? '../.venv/bin/python');
    return { hub, mover: spawnWithTests(python, ['-c', LOOP, port], { cwd: bench.folder, stdio: 'ignore' }) };
  }
  const move = ['rmd', '-p', port, '--id', '1', 'position', '7200000', '--max-speed', '600', '--wait', '--json'];
  return { hub, mover: new Program(move, bench.folder).process };
}

async function world(protocol: 'st' | 'rmd', guarded: boolean, program: Case['program']): Promise<World> {
  const bench = new Bench();
  const port = await bench.listen(protocol);
  const { served, port: kind } = KINDS[protocol];
  const wire = await Wire.open(port);
  let serial = `${kind}tcp:127.0.0.1:${wire.port}`;
  let guard: Program | undefined;
  if (guarded) {
    const at = `${bench.folder}/guarded`;
    guard = new Program(
      ['guard', protocol, '-p', serial, '--serve', `${served}${at}`, '--silence', '500ms', '--json'],
      bench.folder,
    );
    await guard.line(() => true);
    serial = `${kind}${at}`;
  }
  const network = await Network.open();
  const chromium = program ? undefined : await Chromium.open({ proxy: network.proxy });
  const none = { hub: undefined, mover: undefined };
  if (!program) await bench.serve(['-p', serial], '300ms');
  return { bench, wire, network, chromium, guard, ...(program ? await programAt(program, serial, bench) : none) };
}

/**
 * Time until STOP is on the wire, and until the motor stands still, ms. A time is `null` after 20 s. The
 * result is `null` if the motor stopped before the event.
 */
async function run({ protocol = 'st', guarded = false, program, event, from }: Case) {
  const { motor, speed, stop: wanted } = KINDS[protocol];
  const all = await world(protocol, guarded, program);
  const { bench, wire, network, chromium, guard, mover, hub } = all;
  try {
    if (chromium) {
      const page = await chromium.tab();
      await page.goto(bench.url);
      // A page that gets no time for its signs of life turns nothing, or not for long.
      if (!(await spin(page, speed, motor).then(() => true, () => false))) return null;
    }
    const late = performance.now() + 5_000;
    while (!((await bench.speed(protocol, 1)) >= speed / 2)) {
      if (performance.now() > late) return null;
    }
    const happens = await event(all);
    let at = performance.now();
    await happens();
    if (from) at = await from(all);
    const patience = at + 20_000;
    let still: number | null = null;
    while (still === null && performance.now() < patience) {
      if ((await bench.speed(protocol, 1)) < STILL) still = performance.now() - at;
    }
    const stop = wire.when(wanted, at);
    return { stop: stop === undefined ? null : stop - at, still };
  } finally {
    mover?.kill('SIGKILL');
    await hub?.end();
    await chromium?.close();
    await bench.end();
    await guard?.end();
    await wire.close();
    await network.close();
  }
}

function quantiles(all: (number | null)[]) {
  const found = all.filter((one) => one !== null);
  return [0, 0.5, 0.95, 1].map((part) => (found.length > 0 ? quantile(found, part).toFixed(0) : '-'));
}

/** A row of the table. */
async function measure(one: Case): Promise<Cell[]> {
  const results: NonNullable<Awaited<ReturnType<typeof run>>>[] = [];
  let early = 0;
  const stalls = new Stalls();
  while (results.length < RUNS) {
    const result = await run(one);
    if (result) results.push(result);
    // A loaded machine gives a browser no time.
    else if ((early += 1) > RUNS + 5) throw new Error(`${one.name}: motors stop before the event`);
  }
  const stalled = await stalls.end();
  const left = results.filter(({ still }) => still === null).length;
  return [
    one.name, results.length, ...quantiles(results.map(({ stop }) => stop)),
    ...quantiles(results.map(({ still }) => still)), left, early, stalled.length,
  ];
}

test('dead-man', async () => {
  test.setTimeout(4 * 3600 * 1000);
  const rows: Cell[][] = [];
  for (const one of [...CASES, ...HANGING].filter(({ name }) => name.includes(process.env.CASES ?? ''))) {
    rows.push(await measure(one));
    console.log(row(rows.at(-1)!));
  }
  const head = ['event', 'runs', 'STOP min', 'p50', 'p95', 'max', 'still min', 'p50', 'p95', 'max', 'left turning', 'repeated', 'stalls'];
  if (!process.env.CASES) publish('dead-man', table(head, rows));
});
