import { render } from 'preact';
import { App } from './app';
import { start } from './link';
import { stopByKeys } from './stop';
import './style.css';
import { followAddress } from './views';

stopByKeys();
followAddress();
start();
render(<App />, document.getElementById('app')!);
