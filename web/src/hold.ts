// Hold-to-run: motion only while a finger or a key is down on a button.
import { held, release as sayReleased, sayAlive } from './link';

/** The keys that hold. Space stops all motors. */
const KEYS = new Set(['h', 'H', 'Enter']);

/** Takes a button for hold-to-run. Returns what gives it back, which also releases. */
export function holdToRun(button: HTMLElement, began: () => void, ended: () => void): () => void {
  let isDown = false;
  let key: string | null = null;

  const begin = () => {
    if (isDown) return;
    isDown = true;
    held.value = true;
    sayAlive();
    began();
  };
  const release = () => {
    if (!isDown) return;
    isDown = false;
    key = null;
    // Another button may be held. Both end: a release never leaves anything moving.
    sayReleased();
    ended();
  };

  const listeners: [EventTarget, string, (event: Event) => void][] = [
    [button, 'pointerdown', (event) => {
      const { button: which, pointerId } = event as PointerEvent;
      if (which !== 0) return release();
      button.setPointerCapture?.(pointerId);
      begin();
    }],
    [button, 'pointerup', release],
    [button, 'pointercancel', release],
    [button, 'lostpointercapture', release],
    [button, 'contextmenu', (event) => {
      event.preventDefault();
      // A finger that is held long asks for a menu on phones, which does not open then.
      if ((event as PointerEvent).pointerType !== 'touch') release();
    }],
    [button, 'blur', release],
    [button, 'keydown', (event) => {
      const pressed = event as KeyboardEvent;
      if (!KEYS.has(pressed.key)) return;
      event.preventDefault();
      if (pressed.repeat || pressed.ctrlKey || pressed.altKey || pressed.metaKey) return;
      key = pressed.code;
      begin();
    }],
    [button, 'keyup', (event) => {
      if ((event as KeyboardEvent).code === key) release();
    }],
    [window, 'blur', release],
    [window, 'pagehide', release],
    [document, 'visibilitychange', () => {
      if (document.hidden) release();
    }],
  ];
  for (const [target, type, listener] of listeners) target.addEventListener(type, listener);
  // Stop all, a lost connection and a lapse clear it, too.
  const forget = held.subscribe((isHeld) => {
    if (!isHeld) release();
  });
  return () => {
    release();
    forget();
    for (const [target, type, listener] of listeners) target.removeEventListener(type, listener);
  };
}
