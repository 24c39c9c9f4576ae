import { describe, expect, it } from 'vitest';
import { ServerClock } from './clock';

/** A server whose clock is `ahead` ms ahead of the page's. */
function beatAt(clock: ServerClock, sent: number, { ahead = 5_000_000, up = 2, down = 2, since = 40 } = {}) {
  const at = sent - since - up;
  return clock.heard(sent + down, sent + ahead, at, since);
}

describe('the clock of the server', () => {
  it('is unknown until a beat answers a sign of life', () => {
    const clock = new ServerClock();
    expect(clock.heard(100, 9_000, null, 0)).toBeNull();
    expect(clock.at(100)).toBeNaN();
  });

  it('is never early, so that no value looks younger than it is', () => {
    const clock = new ServerClock();
    expect(beatAt(clock, 1000, { up: 30, down: 400 })).toBeCloseTo(430);
    expect(clock.at(2000) - 5_002_000).toBeCloseTo(30);
    beatAt(clock, 1050, { up: 1, down: 1 });
    expect(clock.at(2000) - 5_002_000).toBeCloseTo(1);
  });

  it('keeps the best estimate while beats come late', () => {
    const clock = new ServerClock();
    beatAt(clock, 1000);
    for (let sent = 1050; sent < 3000; sent += 50) beatAt(clock, sent, { up: 900, down: 3000 });
    expect(clock.at(9000) - 5_009_000).toBeLessThan(4);
  });

  it('begins again when the machine of the page was suspended, or a clock was set', () => {
    for (const jump of [60_000, -60_000]) {
      const clock = new ServerClock();
      beatAt(clock, 1000);
      beatAt(clock, 1050, { ahead: 5_000_000 + jump });
      expect(clock.at(2000) - 5_002_000 - jump).toBeCloseTo(2);
    }
  });
});
