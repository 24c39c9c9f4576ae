// The keyboard of a plot. Space and Escape are not used here: they stop motors.
import type { Window } from './window';

export const HELP =
  'Left and right arrow: move cursor A; with Shift: cursor B. Comma and full stop: to the previous and the ' +
  'next sample. Plus and minus: zoom. Page up and page down: earlier and later. Home: oldest values. ' +
  'End: newest values. P: pause. Delete: remove the cursors.';

export interface Actions {
  /** The sample next to `x`, in this direction. */
  step: (x: number, direction: 1 | -1) => number;
  /** The time of the oldest sample. */
  oldest: () => number;
  home: () => void;
  /** The instant at the cursor was chosen. */
  pick: (x: number) => void;
}

type Press = Pick<KeyboardEvent, 'key' | 'shiftKey' | 'ctrlKey' | 'metaKey' | 'altKey'>;

/** Carries out a key. Whether there is such a key. */
export function press({ key, shiftKey, ctrlKey, metaKey, altKey }: Press, window: Window, actions: Actions): boolean {
  if (ctrlKey || metaKey || altKey) return false;
  const cursor = shiftKey ? 'b' : 'a';
  const move = (by: (x: number) => number) => {
    const { min, max } = window;
    const x = window[cursor];
    const moved = x === null ? (min + max) / 2 : by(x);
    window[cursor] = moved;
    if (moved < min || moved > max) window.show(moved - window.span / 2, moved + window.span / 2);
    window.version += 1;
  };
  switch (key) {
    case 'ArrowLeft':
    case 'ArrowRight':
      move((x) => x + (key === 'ArrowLeft' ? -1 : 1) * (window.span / 100));
      return true;
    case ',':
    case '<':
      move((x) => actions.step(x, -1));
      return true;
    case '.':
    case '>':
      move((x) => actions.step(x, 1));
      return true;
    case '+':
    case '=':
      window.zoom(1 / 1.5, window.a ?? undefined);
      return true;
    case '-':
      window.zoom(1.5, window.a ?? undefined);
      return true;
    case 'PageUp':
      window.pan(-0.5);
      return true;
    case 'PageDown':
      window.pan(0.5);
      return true;
    case 'Home': {
      const oldest = actions.oldest();
      if (isFinite(oldest)) window.show(oldest, oldest + window.span);
      return true;
    }
    case 'End':
      actions.home();
      return true;
    case 'p':
    case 'P':
      if (window.live) window.pause();
      else actions.home();
      return true;
    case 'Delete':
    case 'Backspace':
      window.a = null;
      window.b = null;
      window.version += 1;
      return true;
    case 'Enter':
      if (window.a !== null) actions.pick(window.a);
      return window.a !== null;
    default:
      return false;
  }
}
