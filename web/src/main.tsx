import { render } from 'preact';
import { start, state } from './link';

start();
render(<h1>Motorlink monitor: {state}</h1>, document.getElementById('app')!);
