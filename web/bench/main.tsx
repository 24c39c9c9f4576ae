// The view of plots on synthetic signals: `?motors=5&columns=8&rate=100&span=60&past=60`.
import { render } from 'preact';
import { install } from './share';

const query = new URLSearchParams(location.search);
const number = (name: string, or: number) => Number(query.get(name) ?? or);
const motors = Array.from({ length: number('motors', 5) }, (_, index) => index + 1);
const units = ['rpm', 'A', 'V', '°C', ''];
const columns = Array.from({ length: number('columns', 8) }, (_, index) => ({
  name: `SIGNAL_${index + 1}`,
  unit: units[index % number('units', 2)]!,
}));
const pause = query.has('pause') ? { pause: { every: 7, length: 1.5 } } : {};
install({ line: 'st0', motors, columns, past: number('past', 60), spikes: 3000, ...pause });

const layout = query.get('layout') ?? 'one';
const chosen = motors.flatMap((motor) => columns.map(({ name }) => ({ line: 'st0', motor, name, rate: number('rate', 100) })));
localStorage.setItem('motorlink.plots', JSON.stringify({ signals: chosen, span: number('span', 60), layout }));

const { start } = await import('../src/link');
const { default: Plots } = await import('../src/views/plots');
const { store } = await import('../src/plot/live');
Object.assign(globalThis, { store });
start();
render(<Plots />, document.getElementById('app')!);
