import type { ComponentChildren } from 'preact';
import { useEffect, useId, useRef } from 'preact/hooks';
import { nameOf } from '../format';
import { stopAll } from '../stop';
import type { MotorName } from '../wire';

/**
 * Asks before something that cannot be undone. A modal dialog covers the button that stops all motors,
 * so it has its own.
 */
export function Confirm({
  title, action, onDone, children,
}: {
  title: string;
  action: string;
  onDone: (isConfirmed: boolean) => void;
  children: ComponentChildren;
}) {
  const dialog = useRef<HTMLDialogElement>(null);
  const cancel = useRef<HTMLButtonElement>(null);
  const heading = useId();
  const text = useId();
  useEffect(() => {
    const before = document.activeElement;
    dialog.current?.showModal();
    cancel.current?.focus();
    return () => {
      if (before instanceof HTMLElement) before.focus();
    };
  }, []);
  return (
    <dialog
      ref={dialog}
      class="confirm"
      aria-labelledby={heading}
      aria-describedby={text}
      onCancel={() => onDone(false)}
      onKeyDown={({ key }) => {
        // The browser does not see this Escape: it stops all motors.
        if (key === 'Escape') onDone(false);
      }}
    >
      <h2 id={heading}>{title}</h2>
      <div id={text}>{children}</div>
      <div class="buttons">
        <button type="button" ref={cancel} onClick={() => onDone(false)}>
          Cancel
        </button>
        <button type="button" class="danger" onClick={() => onDone(true)}>
          {action}
        </button>
        <button type="button" class="stop" onClick={stopAll}>
          Stop all motors
        </button>
      </div>
    </dialog>
  );
}

/** What a write to the ROM wears out. */
export function RomWear({ motor: { line, motor } }: { motor: MotorName }) {
  return (
    <p>
      This writes the ROM of motor {nameOf(line, motor)}. Each write wears the ROM, which lasts for a limited number of
      writes. What is written stays after power-off.
    </p>
  );
}
