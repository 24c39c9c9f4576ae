// The part of time that plots show: it follows the newest values, or stands still.

export class Window {
  min = 0;
  max = 1;
  /** Whether it follows the newest values. */
  live: boolean;
  /** Changes whenever the user moves it. */
  version = 0;
  /** The cursors. */
  a: number | null = null;
  b: number | null = null;
  private latest = NaN;

  /** `whole` is all that can be shown. */
  constructor(
    public span: number,
    live: boolean,
    private readonly least: number,
    private readonly most: number,
  ) {
    this.live = live;
  }

  /** Moves to the newest values. Small steps back of the clock are ignored: they would tremble. */
  follow(now: number) {
    if (isNaN(now)) return;
    if (!(now < this.latest) || this.latest - now > 1) this.latest = now;
    if (!this.live) return;
    this.max = this.latest;
    this.min = this.latest - this.span;
  }

  /** Shows this part, as near as the limits permit. */
  show(min: number, max: number) {
    this.span = Math.min(Math.max(max - min, this.least), this.most);
    const middle = (min + max) / 2;
    this.min = middle - this.span / 2;
    this.max = middle + this.span / 2;
    this.live = false;
    this.version += 1;
  }

  /** Scales the span, and keeps `x` at its place; while live: the newest values. */
  zoom(factor: number, x = this.live ? this.max : (this.min + this.max) / 2) {
    const span = Math.min(Math.max(this.span * factor, this.least), this.most);
    const share = this.live ? 1 : (x - this.min) / (this.max - this.min);
    this.max = (this.live ? this.max : x) + span * (1 - share);
    this.min = this.max - span;
    this.span = span;
    this.version += 1;
  }

  /** Moves by this share of the span. Earlier than live is not live; the newest end of live is kept. */
  pan(share: number) {
    if (this.live && share >= 0) return;
    const by = share * this.span;
    if (by > 0 && this.max + by >= this.latest) {
      this.resume();
      return;
    }
    this.live = false;
    this.min += by;
    this.max += by;
    this.version += 1;
  }

  /** Whether a cursor is set, and not in the visible part. */
  isOutside(cursor: number | null): boolean {
    return cursor !== null && (cursor < this.min || cursor > this.max);
  }

  /** Shows the part with the cursors, with the same span if it is long enough. */
  showCursors() {
    const set = [this.a, this.b].filter((cursor) => cursor !== null);
    if (set.length === 0) return;
    const [first, last] = [Math.min(...set), Math.max(...set)];
    const half = Math.max(this.span, 1.1 * (last - first)) / 2;
    const middle = (first + last) / 2;
    this.show(middle - half, middle + half);
  }

  pause() {
    this.live = false;
    this.version += 1;
  }

  /** Back to the newest values, with this span. */
  resume(span = this.span) {
    this.live = true;
    this.span = Math.min(Math.max(span, this.least), this.most);
    this.version += 1;
    this.follow(this.latest);
  }
}
