// The page as a browser loads it, compressed. Fails if it is too big.
import { readdirSync, readFileSync } from 'node:fs';
import { gzipSync } from 'node:zlib';

const MOST_KB = 200;
const files = readdirSync('dist', { recursive: true, withFileTypes: true }).filter((file) => file.isFile());
const sizes = files.map((file) => gzipSync(readFileSync(`${file.parentPath ?? file.path}/${file.name}`)).length);
const kb = sizes.reduce((sum, size) => sum + size, 0) / 1000;
console.log(`the page: ${kb.toFixed(1)} kB compressed in ${files.length} files, at most ${MOST_KB} kB`);
if (kb > MOST_KB) process.exitCode = 1;
