// Asks what answers on a port that no line has, at its rate and then at the others that it can choose.
// The share tries one rate per request, so a scan needs no state there, and ends when the page does.
import type { AnswerTo } from '../link';
import type { Sentence } from '../parts';
import type { Finding, Protocol } from '../wire';
import { askPorts } from './ask';

export type Scanned = AnswerTo<'scan'>;

export interface Wanted {
  port: string;
  protocol: Protocol;
  /** For each reply, in seconds; a short time without it. */
  timeout: number | null;
}

export interface Steps {
  /** What was found at a rate, and how many rates are left. */
  found: (answer: Scanned, left: number) => void;
  /** Whether other bit rates may be tried: they disturb a bus. */
  mayDisturb: () => Promise<boolean>;
  isEnded: () => boolean;
}

/** After these no other rate is tried. */
const LAST: ReadonlySet<Finding> = new Set(['drive', 'refuses', 'foreign', 'echo']);

export const isDrive = ({ finding }: Scanned) => finding === 'drive' || finding === 'refuses';

/** A rate, for people. */
export const rateText = (rate: number, protocol: Protocol) =>
  protocol === 'st' ? `${rate} baud` : `${rate / 1000} kbit/s`;

/** The longest time for a reply in a scan, in seconds. */
const LONGEST = 5;

/** Scans until something answers. What it came to, in words. */
export async function scan(form: Wanted, { found, mayDisturb, isEnded }: Steps): Promise<Sentence> {
  const wanted = { ...form, timeout: form.timeout && Math.min(form.timeout, LONGEST) };
  const first = await askPorts({ ask: 'scan', ...wanted, rate: null });
  const others = first.rates.filter((rate) => rate !== first.rate);
  found(first, others.length);
  let last = first;
  let count = 1;
  if (!LAST.has(first.finding) && others.length > 0 && wanted.protocol === 'rmd' && !(await mayDisturb())) {
    return { tone: 'note', text: 'No motor answered. Other bit rates were not tried.' };
  }
  let hasBytes = first.finding === 'garbage';
  for (const rate of others) {
    if (LAST.has(last.finding)) break;
    if (isEnded()) return { tone: 'note', text: `The scan was ended after ${count} of ${others.length + 1} rates.` };
    last = await askPorts({ ask: 'scan', ...wanted, rate });
    hasBytes ||= last.finding === 'garbage';
    count += 1;
    found(last, others.length + 1 - count);
  }
  return summary(last, count, hasBytes);
}

function summary(last: Scanned, count: number, hasBytes: boolean): Sentence {
  if (isDrive(last)) return { tone: 'ok', text: `Found: ${last.text}. Open opens it as ${last.port}.` };
  if (last.finding === 'foreign') return { tone: 'bad', text: `Nothing that can be driven from here: ${last.text}.` };
  if (last.finding === 'echo') return { tone: 'bad', text: `An echo: ${last.text}.` };
  const tried = count === 1 ? 'No drive answered' : `No drive answered at any of ${count} rates`;
  return {
    tone: 'bad',
    text: hasBytes
      ? `${tried}, but bytes were received. Is it the right port, and the right protocol?`
      : `${tried}. Has it power? Are RX and TX crossed, or is the bus terminated? Has another program the port?`,
  };
}
