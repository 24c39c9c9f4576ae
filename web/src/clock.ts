// The server's wall clock, estimated from its beats.

/** Clocks of machines differ by less than this each beat, in ms. */
const DRIFT = 0.01;

/** All times are in ms. */
export class ServerClock {
  private low = -Infinity;
  private high = Infinity;

  forget() {
    this.low = -Infinity;
    this.high = Infinity;
  }

  /**
   * A beat was received at `now`. It was sent at `wall` of the server's clock, `since` ms after the
   * server received the sign of life that the page sent at `at`. Returns the time to the server and
   * back, or null if no sign of life was received yet.
   */
  heard(now: number, wall: number, at: number | null, since: number): number | null {
    if (at === null) return null;
    // The server sent the beat before now, and received the sign of life after `at`.
    const low = wall - now;
    const high = wall - since - at;
    this.low = Math.max(this.low - DRIFT, low);
    this.high = Math.min(this.high + DRIFT, high);
    // A clock was set, or a machine was suspended.
    if (this.low > this.high) [this.low, this.high] = [low, high];
    return Math.max(0, high - low);
  }

  /**
   * The latest that the server's clock can show at `now`. So no value looks younger than it is.
   * NaN until a beat answered a sign of life.
   */
  at(now: number): number {
    return Number.isFinite(this.high) ? now + this.high : NaN;
  }
}
