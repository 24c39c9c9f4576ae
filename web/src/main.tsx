import { render } from 'preact';

render(<h1>Motorlink monitor</h1>, document.getElementById('app')!);
