// When plots are drawn: in frames of the browser, only if something changed, and never so often that
// drawing takes more than half of the main thread. Signs of life need the rest.
import type { Window } from './window';

/** What is drawn together. */
export interface Panel {
  /** Whether it is on the screen. */
  visible: boolean;
  draw: () => void;
  /** Writes the numbers beside the curves. */
  write: () => void;
}

const NUMBERS = 60;
const STALE = 250;
const UNSEEN = 1000;
const CALM = 500;
/** The browser paints about twice as long as the script runs, afterwards. */
const PAUSE = 4;

export class Scheduler {
  private readonly panels = new Set<Panel>();
  private handle = 0;
  private timer: ReturnType<typeof setInterval> | undefined;
  private earliest = 0;
  private written = -Infinity;
  private drawnAll = -Infinity;
  /** What the user sees is wrong, and has to be drawn at once. */
  private dirty = false;
  /** There is something new. */
  private grown = false;
  private drawn = -Infinity;

  constructor(
    readonly window: Window,
    /** The right end of live plots. Finished data have none. */
    private readonly now: (() => number) | null = null,
    /** Whether live plots move in few steps, for people who do not want motion. */
    private readonly isCalm: () => boolean = () => false,
  ) {}

  add(panel: Panel): () => void {
    this.panels.add(panel);
    // Without new samples plots scroll on slowly, and values become old.
    if (this.now) this.timer ??= setInterval(this.sampled, STALE);
    this.request();
    return () => {
      this.panels.delete(panel);
      if (this.panels.size > 0) return;
      clearInterval(this.timer);
      this.timer = undefined;
      cancelAnimationFrame(this.handle);
      this.handle = 0;
    };
  }

  /** Something changed: draw. */
  request = () => {
    this.dirty = true;
    this.wake();
  };

  /** New samples. A plot that stands still shows them as numbers only. */
  sampled = () => {
    if (this.window.live) this.grown = true;
    this.wake();
  };

  private wake() {
    if (this.handle === 0 && this.panels.size > 0) this.handle = requestAnimationFrame(this.frame);
  }

  private readonly frame = (time: number) => {
    this.handle = 0;
    if (time < this.earliest) {
      this.wake();
      return;
    }
    const start = performance.now();
    const write = time - this.written >= NUMBERS || (this.dirty && !this.window.live);
    const due = this.grown && time - this.drawn >= (this.isCalm() ? CALM : 0);
    const draws = this.dirty || due;
    if (draws) {
      if (this.now) this.window.follow(this.now());
      this.drawn = time;
    } else if (this.grown) {
      this.wake();
    }
    // What is not on the screen may be printed, or scrolled into view.
    const all = time - this.drawnAll >= UNSEEN;
    if (all) this.drawnAll = time;
    for (const panel of this.panels) {
      if (!panel.visible && !all) continue;
      if (draws) panel.draw();
      if (write || all) panel.write();
    }
    if (write) this.written = time;
    this.dirty = false;
    if (draws) this.grown = false;
    this.earliest = time + PAUSE * (performance.now() - start);
  };
}
