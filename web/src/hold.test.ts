import { signal } from '@preact/signals';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';

const held = signal(false);
const said: boolean[] = [];
vi.mock('./link', () => ({
  held,
  sayAlive: () => said.push(held.value),
  release: () => {
    held.value = false;
    said.push(false);
  },
}));

class Button extends EventTarget {
  setPointerCapture = vi.fn();
}

let button: Button;
let page: EventTarget & { hidden: boolean };
let frame: EventTarget;
let began: ReturnType<typeof vi.fn<() => void>>;
let ended: ReturnType<typeof vi.fn<() => void>>;
let end: () => void;

beforeEach(async () => {
  said.length = 0;
  held.value = false;
  button = new Button();
  page = Object.assign(new EventTarget(), { hidden: false });
  frame = new EventTarget();
  vi.stubGlobal('document', page);
  vi.stubGlobal('window', frame);
  began = vi.fn();
  ended = vi.fn();
  const { holdToRun } = await import('./hold');
  end = holdToRun(button as unknown as HTMLElement, began, ended);
});

afterEach(() => {
  end();
  vi.unstubAllGlobals();
});

const give = (target: EventTarget, type: string, more: object = {}) =>
  target.dispatchEvent(Object.assign(new Event(type, { cancelable: true }), more));
const press = () => give(button, 'pointerdown', { button: 0, pointerId: 1 });
const key = (type: string, name: string, more: object = {}) =>
  give(button, type, { key: name, code: name === 'Enter' ? 'Enter' : 'KeyH', repeat: false, ...more });

describe('hold to run', () => {
  it('says at once that it is held', () => {
    press();
    expect(said).toEqual([true]);
    expect(began).toHaveBeenCalledOnce();
    expect(button.setPointerCapture).toHaveBeenCalledWith(1);
  });

  const releases: [string, () => void][] = [
    ['pointerup', () => give(button, 'pointerup')],
    ['pointercancel', () => give(button, 'pointercancel')],
    ['lostpointercapture', () => give(button, 'lostpointercapture')],
    ['a menu of the mouse', () => give(button, 'contextmenu', { pointerType: 'mouse' })],
    ['a menu of the keyboard', () => give(button, 'contextmenu')],
    ['a second button of the mouse', () => give(button, 'pointerdown', { button: 2, pointerId: 1 })],
    ['blur of the button', () => give(button, 'blur')],
    ['blur of the window', () => give(frame, 'blur')],
    ['pagehide', () => give(frame, 'pagehide')],
    [
      'a hidden tab',
      () => {
        page.hidden = true;
        give(page, 'visibilitychange');
      },
    ],
    ['a stop, a lapse or a lost connection', () => void (held.value = false)],
    ['the end of the button', () => end()],
  ];
  it.each(releases)('ends at once with %s, once', (_, release) => {
    press();
    release();
    give(button, 'pointerup');
    expect(held.value).toBe(false);
    expect(said).toEqual([true, false]);
    expect(ended).toHaveBeenCalledOnce();
  });

  it('lasts while a phone asks for a menu under the finger, which does not open', () => {
    press();
    const opens = give(button, 'contextmenu', { pointerType: 'touch' });
    expect(opens).toBe(false);
    expect(held.value).toBe(true);
  });

  it.each(['h', 'H', 'Enter'])('lasts from key down to key up of %s, and ignores repetitions', (name) => {
    key('keydown', name);
    key('keydown', name, { repeat: true });
    expect(began).toHaveBeenCalledOnce();
    give(button, 'keyup', { key: 'a', code: 'KeyA' });
    expect(held.value).toBe(true);
    key('keyup', name);
    expect(held.value).toBe(false);
    expect(ended).toHaveBeenCalledOnce();
  });

  it('does not begin by a key that repeats, after it was ended otherwise', () => {
    key('keydown', 'h');
    give(button, 'blur');
    key('keydown', 'h', { repeat: true });
    expect(held.value).toBe(false);
    expect(began).toHaveBeenCalledOnce();
  });

  it('does not begin by Space, by other keys or by keys of the browser', () => {
    key('keydown', ' ');
    key('keydown', 'x');
    key('keydown', 'h', { ctrlKey: true });
    expect(began).not.toHaveBeenCalled();
  });
});
