// The views of the page. Each is a module of its own in views/, with a component as default export.
import { signal } from '@preact/signals';
import type { ComponentType } from 'preact';

export interface View {
  /** The name of the module, and after `#/` in the address. */
  path: string;
  title: string;
}

export const VIEWS: readonly [View, ...View[]] = [
  { path: 'motors', title: 'Motors' },
  { path: 'plots', title: 'Plots' },
  { path: 'registers', title: 'Registers' },
  { path: 'step', title: 'Step response' },
  { path: 'wire', title: 'Wire' },
  { path: 'recordings', title: 'Recordings' },
  { path: 'events', title: 'Events' },
  { path: 'ports', title: 'Ports' },
];

const modules = import.meta.glob<{ default: ComponentType }>(
  './views/{motors,plots,registers,step,wire,recordings,events,ports}.tsx',
);

/** Loads a view, or gives null if this build does not have it. */
export async function load({ path }: View): Promise<ComponentType | null> {
  const module = await modules[`./views/${path}.tsx`]?.();
  return module?.default ?? null;
}

const fromAddress = (): View => {
  const path = location.hash.replace(/^#\/?/, '').split(/[/?]/)[0];
  return VIEWS.find((view) => view.path === path) ?? VIEWS[0];
};

/** The view that the address names. */
export const view = signal<View>(VIEWS[0]);

/** Follows the address. */
export function followAddress() {
  const follow = () => {
    view.value = fromAddress();
    document.title = `${view.value.title} - Motorlink monitor`;
  };
  addEventListener('hashchange', follow);
  follow();
}
