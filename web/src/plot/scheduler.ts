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
/** The browser paints about twice as long as the script runs, afterwards. */
const PAUSE = 4;

export class Scheduler {
  private readonly panels = new Set<Panel>();
  private handle = 0;
  private timer: ReturnType<typeof setInterval> | undefined;
  private earliest = 0;
  private written = -Infinity;
  private drawnAll = -Infinity;
  private dirty = false;

  /** `now` is the right end of live plots. */
  constructor(
    readonly window: Window,
    private readonly now: () => number = () => NaN,
  ) {}

  add(panel: Panel): () => void {
    this.panels.add(panel);
    // Without new samples plots scroll on slowly, and values become old.
    this.timer ??= setInterval(() => this.window.live && this.request(), STALE);
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
    if (this.window.live) this.dirty = true;
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
    if (this.dirty) this.window.follow(this.now());
    // What is not on the screen may be printed, or scrolled into view.
    const all = time - this.drawnAll >= UNSEEN;
    if (all) this.drawnAll = time;
    for (const panel of this.panels) {
      if (!panel.visible && !all) continue;
      if (this.dirty) panel.draw();
      if (write || all) panel.write();
    }
    if (write) this.written = time;
    this.dirty = false;
    this.earliest = time + PAUSE * (performance.now() - start);
  };
}
