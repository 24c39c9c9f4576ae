// What is said after faults were acknowledged: whether a cause is still present.
import { descriptions } from './drives';
import { told } from './faults';
import { age } from './link';
import { liveOf } from './overview';
import type { Sentence } from './parts';

/** For so long the next value of the faults is awaited, in ms. */
const PATIENCE = 3000;
const LOOK = 50;

/** Call it at the acknowledge of the drive. It waits for a value of the faults that was read later. */
export async function afterAcknowledge(line: string, motor: number): Promise<Sentence> {
  const since = performance.now();
  const description = descriptions.peek().get(line);
  for (;;) {
    const passed = performance.now() - since;
    const last = description && liveOf(line, motor).values.get(description.overview.faults);
    if (last && age(last.wall) * 1000 < passed) {
      const names = told(last.value, description.faults).shown.flatMap(({ name, present }) => (present ? [name] : []));
      if (names.length === 0) return { tone: 'ok', text: 'Faults acknowledged.' };
      const verb = names.length === 1 ? 'is' : 'are';
      return { tone: 'bad', text: `Acknowledged, but ${names.join(', ')} ${verb} still present.` };
    }
    if (passed > PATIENCE) return { tone: 'note', text: 'Acknowledged. The faults could not be read after it.' };
    await new Promise((done) => setTimeout(done, LOOK));
  }
}
