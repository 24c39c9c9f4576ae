// What a page draws and when, seen from inside of the page.
import type { Page } from '@playwright/test';

/** The first three curves of the plot are this one: the clock of the drives, and two that never change. */
export type Places = [clock: number, low: number, high: number];

export interface Seen {
  /** The times at which frames began, in ms of the page. */
  frames: number[];
  /** How often curves were drawn. */
  draws: number;
  /** Where the newest values of the first three curves were drawn, and when the next frame began. */
  curves: { at: number; y: Places }[];
  /** The number beside the clock's curve, in the same way. */
  numbers: { at: number; value: number }[];
}

declare global {
  var probing: { clear: () => void; seen: () => Seen; watch: (cell: Element) => void };
}

/** Runs in the page, before its scripts. */
function install() {
  let frames: number[] = [];
  let curves: Seen['curves'] = [];
  let numbers: Seen['numbers'] = [];
  let draws = 0;
  let strokes: number[] = [];
  let number: number | null = null;

  class Path extends Path2D {
    newest = NaN;
    override moveTo(x: number, y: number) {
      this.newest = y;
      super.moveTo(x, y);
    }
    override lineTo(x: number, y: number) {
      this.newest = y;
      super.lineTo(x, y);
    }
  }
  globalThis.Path2D = Path;
  const canvas = CanvasRenderingContext2D.prototype;
  const { clearRect, stroke } = canvas;
  const plain = stroke as () => void;
  canvas.clearRect = function (...rectangle) {
    draws += 1;
    strokes = [];
    clearRect.apply(this, rectangle);
  };
  canvas.stroke = function (path?: Path2D) {
    if (path instanceof Path) strokes.push(path.newest);
    if (path) stroke.call(this, path);
    else plain.call(this);
  };
  // The first callback of each frame: what the frame before has drawn is on its way to the screen.
  const begin = () => {
    requestAnimationFrame(begin);
    const at = performance.now();
    frames.push(at);
    const y = strokes.slice(0, 3) as Places;
    if (y.length === 3 && y.every(isFinite)) curves.push({ at, y });
    if (number !== null) numbers.push({ at, value: number });
    strokes = [];
    number = null;
  };
  requestAnimationFrame(begin);
  globalThis.probing = {
    clear: () => {
      [frames, curves, numbers] = [[], [], []];
      draws = 0;
    },
    seen: () => ({ frames, draws, curves, numbers }),
    watch: (cell) =>
      new MutationObserver(() => (number = Number(cell.textContent))).observe(cell, { childList: true, subtree: true, characterData: true }),
  };
}

/** Prepares a page that is not open yet. */
export const probe = (page: Page) => page.addInitScript(install);

/** The time of a page, in ms, between two times of this process. */
export async function pageTime(page: Page) {
  const before = performance.now();
  const now = await page.evaluate(() => performance.now());
  return { now, before, after: performance.now() };
}
