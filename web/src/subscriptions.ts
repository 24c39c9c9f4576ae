// Subscriptions to what is wanted now: motors come and go.
import { effect } from '@preact/signals';
import { nodeOf } from './format';
import { type Refused, type Rows, subscribe } from './link';
import type { SignalName } from './wire';

/** Changes that are so near to each other, in ms, are one: motors come in groups. */
const SETTLE = 150;

export interface Wanted {
  signals: SignalName[];
  /** In seconds. */
  period: number;
}

/** Each node gets its own subscription, so that a change at one of them does not concern the others. */
function byNode(all: Wanted[]): Map<string, Wanted> {
  const parts = new Map<string, Wanted>();
  for (const { signals, period } of all) {
    const nodes = new Map<string, SignalName[]>();
    for (const signal of signals) {
      const node = nodeOf(signal.line) ?? '';
      const ofNode = nodes.get(node);
      if (ofNode) ofNode.push(signal);
      else nodes.set(node, [signal]);
    }
    for (const [node, ofNode] of nodes) {
      const names = ofNode.map(({ line, motor, name }) => `${line} ${motor} ${name}`);
      parts.set(`${node} ${period} ${names.join()}`, { signals: ofNode, period });
    }
  }
  return parts;
}

/** Subscribes to what `wanted` gives, again with each signal that it reads. Returns what ends it. */
export function follow(
  wanted: () => Wanted[],
  onRows: (rows: Rows) => void,
  onRefused: (why: Refused | null) => void = () => {},
): () => void {
  const running = new Map<string, () => void>();
  let timer: ReturnType<typeof setTimeout> | undefined;
  const set = (all: Wanted[]) => {
    const parts = byNode(all);
    onRefused(null);
    for (const [key, end] of running) {
      if (parts.has(key)) continue;
      end();
      running.delete(key);
    }
    for (const [key, { signals, period }] of parts) {
      if (!running.has(key)) running.set(key, subscribe(signals, period, onRows, { rows: true, onRefused }));
    }
  };
  const stop = effect(() => {
    const all = wanted();
    clearTimeout(timer);
    const isFirst = running.size === 0;
    const isLast = all.every(({ signals }) => signals.length === 0);
    if (isFirst || isLast) set(all);
    else timer = setTimeout(() => set(all), SETTLE);
  });
  return () => {
    stop();
    clearTimeout(timer);
    running.forEach((end) => end());
  };
}
