// What the server said last.
import { signal } from '@preact/signals';
import type { Event as DriveEvent, Line, RunResult, Recorded, Welcome } from './wire';

/** `silent`: the socket seems open, and what comes through it is late, or nothing comes. */
export const state = signal<'connecting' | 'open' | 'silent' | 'lost'>('connecting');
export const welcome = signal<Welcome | null>(null);
/** What the last welcome said. It stays when the connection is lost. */
export const lastWelcome = signal<Welcome | null>(null);
export const lines = signal<Line[]>([]);
/** Who latched the share: motion is refused. */
export const latchedBy = signal<string | null>(null);
/** The number of the last entry before the answer that `lines` is from. */
export const linesAt = signal(0);
/** The motors of each line: those that the last search found, and those that answered the share before. */
export const motors = signal<ReadonlyMap<string, readonly number[]>>(new Map());
/** The motors that the last search of each line found. */
export const found = signal<ReadonlyMap<string, readonly number[]>>(new Map());
/** Why the last search of a line found nothing, by line. */
export const searchFailed = signal<ReadonlyMap<string, string>>(new Map());
/** An event, or several commands of a program to a motor in a row. */
export interface Entry extends DriveEvent {
  /** Counts the entries. */
  number: number;
  /** How many events this is. The message is that of the last. */
  times: number;
  /** When the last of them happened. */
  until: number;
}

/** All that happened, the newest last. */
export const entries = signal<readonly Entry[]>([]);
/** The last events, each as it came, the newest last. */
export const events = signal<readonly DriveEvent[]>([]);
/** Rows that were left out because nothing confirmed them, by line. */
export const unconfirmed = signal<ReadonlyMap<string, number>>(new Map());
/** Why the page's motors were stopped last. */
export const lapsed = signal<string | null>(null);
/** Why the server closed the last connection. */
export const closedWhy = signal<string | null>(null);
/** Why the share is lost. */
export const shareLost = signal<string | null>(null);
/** The recording that is made, or the last one. */
export const recorded = signal<Recorded | null>(null);
/** The end of the references that the server sent last to each motor, by its name in texts. */
export const rans = signal<ReadonlyMap<string, RunResult>>(new Map());
/** Whether this page turned motors, so that its end stops them. */
export const holds = signal(false);
/** Time to the server and back, in ms. It grows while nothing is received. */
export const delay = signal(0);
/** Whether the key or the finger of hold-to-run is down. */
export const held = signal(false);
