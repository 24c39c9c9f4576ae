// Requests about ports, which shares of earlier versions do not have.
import { type AnswerTo, type Ask, ask } from '../link';

type OfPorts = Extract<Ask, { ask: 'ports' | 'scan' | 'open' | 'close' }>;

export function askPorts<A extends OfPorts>(wanted: A): Promise<AnswerTo<A['ask']>> {
  return ask(wanted).catch(told);
}

/** What a share of an earlier version says is for programs. */
function told(why: unknown): never {
  const text = (why as Error).message;
  if (!text.includes('unknown variant')) throw why;
  throw new Error('This share is of an earlier version, which cannot do this. Update motorlink there.');
}
