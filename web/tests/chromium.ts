// A browser as people have it: its tabs are hidden when another one is in front, and its processes can be
// killed and frozen.
import { chromium, type Browser, type Page } from '@playwright/test';
import type { ChildProcess } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { spawnWithTests } from './bench';

export const PROGRAM = process.env.CHROMIUM ?? '/usr/bin/chromium';
/** Its background services would look for the network. Root has no sandbox. */
export const ARGUMENTS = [
  '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync',
];

export class Chromium {
  private constructor(
    private readonly process: ChildProcess,
    private readonly folder: string,
    private readonly address: string,
    private connected: Browser,
  ) {}

  get browser(): Browser {
    return this.connected;
  }

  static async open({ proxy }: { proxy?: { server: string; bypass: string } } = {}) {
    const folder = mkdtempSync(join(tmpdir(), 'chromium-'));
    const through = proxy ? [`--proxy-server=${proxy.server}`, `--proxy-bypass-list=${proxy.bypass}`] : [];
    const started = spawnWithTests(
      PROGRAM,
      [
        ...ARGUMENTS, ...through, '--headless', '--window-size=1280,900', '--remote-debugging-port=0',
        `--user-data-dir=${folder}`, 'about:blank',
      ],
      { stdio: 'ignore', detached: true },
    );
    const file = join(folder, 'DevToolsActivePort');
    while (!existsSync(file) || !readFileSync(file, 'utf8').includes('\n')) {
      if (started.exitCode !== null) throw new Error(`${PROGRAM} has ended`);
      await new Promise((done) => setTimeout(done, 20));
    }
    const address = `http://127.0.0.1:${readFileSync(file, 'utf8').split('\n')[0]}`;
    return new Chromium(started, folder, address, await connect(address));
  }

  /** Leaves the browser alone, which goes on: it tells tests of each message of its pages. */
  async leave() {
    await this.browser.close();
  }

  /** Goes back after `leave`. */
  async join() {
    this.connected = await connect(this.address);
  }

  /** Opens a tab, in front of the others. */
  async tab(): Promise<Page> {
    return this.browser.contexts()[0]!.newPage();
  }

  /** The tab that shows a page. After `join` the tabs have another order. */
  get page(): Page {
    return this.browser.contexts()[0]!.pages().find((page) => page.url() !== 'about:blank')!;
  }

  /** The processes that run pages. */
  async renderers() {
    const session = await this.browser.newBrowserCDPSession();
    const { processInfo } = await session.send('SystemInfo.getProcessInfo');
    await session.detach();
    return processInfo.filter(({ type }) => type === 'renderer').map(({ id }) => id);
  }

  /** What sends a signal to the processes that run pages, at once. */
  async signals(signal: NodeJS.Signals) {
    const ids = await this.renderers();
    return () => ids.forEach((id) => process.kill(id, signal));
  }

  /** Ends the whole browser, as a crash does. */
  kill() {
    end(this.process);
  }

  async close() {
    const ended = new Promise((done) => this.process.once('exit', done));
    const hasEnded = this.process.exitCode !== null || this.process.signalCode !== null;
    end(this.process);
    if (!hasEnded) await ended;
    // Its other processes end a moment later, and write until then.
    rmSync(this.folder, { recursive: true, force: true, maxRetries: 20, retryDelay: 100 });
  }
}

/** The defaults of Playwright keep every tab visible. */
const connect = (address: string) => chromium.connectOverCDP(address, { noDefaults: true });

/** Ends a browser with the processes that it started. */
function end({ pid }: ChildProcess) {
  try {
    process.kill(-pid!, 'SIGKILL');
  } catch {
    // They have ended.
  }
}
