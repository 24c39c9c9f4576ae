import { Worker } from 'node:worker_threads';

/** Shorter ones are usual on a busy computer. */
export const STALL = 100;

/** Sleeps again and again, and says when it woke too late. */
const WATCH = `
  const { parentPort } = require('node:worker_threads');
  const cell = new Int32Array(new SharedArrayBuffer(4));
  for (let last = performance.now(); ; ) {
    Atomics.wait(cell, 0, 0, 5);
    const now = performance.now();
    if (now - last > ${STALL}) parentPort.postMessage(now - last);
    last = now;
  }
`;

/** For how long the computer gave a thread no time that does nothing but wait, in ms. */
export class Stalls {
  readonly found: number[] = [];
  private readonly thread = new Worker(WATCH, { eval: true });

  constructor() {
    this.thread.on('message', (length: number) => this.found.push(length));
  }

  async end() {
    await this.thread.terminate();
    return this.found;
  }
}
