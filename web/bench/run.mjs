// How smoothly the plots are drawn: the view on synthetic signals, in headless Chromium. `npm run bench`.
// Arguments: seconds of each measurement (default 20).
import { chromium } from '@playwright/test';
import { mkdtempSync, rmSync } from 'node:fs';
import { cpus, tmpdir } from 'node:os';
import { fileURLToPath } from 'node:url';
import { join } from 'node:path';
import { build, preview } from 'vite';

const SECONDS = Number(process.argv[2] ?? 20);
const CASES = [
  { name: '40 x 100 Hz, 10 s', query: 'motors=5&columns=8&rate=100&span=10&past=10' },
  { name: '40 x 100 Hz, 60 s', query: 'motors=5&columns=8&rate=100&span=60&past=60' },
  { name: '40 x 100 Hz, 10 min', query: 'motors=5&columns=8&rate=100&span=600&past=600' },
  { name: '40 x 100 Hz, 60 s, a plot a motor', query: 'motors=5&columns=8&rate=100&span=60&past=60&layout=motor' },
  { name: '40 x 1 kHz, 60 s', query: 'motors=5&columns=8&rate=1000&span=60&past=60' },
];

const root = fileURLToPath(new URL('.', import.meta.url));
const outDir = mkdtempSync(join(tmpdir(), 'motorlink-bench-'));
const common = { root, base: './', configFile: false, logLevel: 'error' };
const jsx = { jsx: { runtime: 'automatic', importSource: 'preact' } };
await build({ ...common, oxc: jsx, build: { outDir, emptyOutDir: true, target: 'es2022' } });
const server = await preview({ ...common, build: { outDir }, preview: { host: '127.0.0.1', port: 0 } });
const { port } = server.httpServer.address();
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: [
    '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--enable-precise-memory-info',
  ],
});

/** In the page: times of frames, and how often curves were drawn, for `ms`. */
function measure(ms) {
  return new Promise((done) => {
    const times = [];
    let draws = 0;
    const drawn = new Set();
    const clear = CanvasRenderingContext2D.prototype.clearRect;
    CanvasRenderingContext2D.prototype.clearRect = function (...args) {
      draws += 1;
      drawn.add(this.canvas);
      return clear.apply(this, args);
    };
    const start = performance.now();
    const frame = (now) => {
      times.push(now);
      if (performance.now() - start < ms) return requestAnimationFrame(frame);
      CanvasRenderingContext2D.prototype.clearRect = clear;
      const steps = times.slice(1).map((time, index) => time - times[index]).sort((a, b) => a - b);
      const at = (share) => steps[Math.min(steps.length - 1, Math.floor(share * steps.length))];
      done({
        frames: (1000 * steps.length) / (times.at(-1) - times[0]),
        draws: (1000 * draws) / ms / drawn.size,
        p50: at(0.5),
        p99: at(0.99),
        most: steps.at(-1),
        heap: performance.memory.usedJSHeapSize / 1e6,
        samples: globalThis.store.curves.reduce((sum, { samples: { bytes } }) => sum + bytes, 0) / 1e6,
        kept: globalThis.store.kept,
      });
    };
    requestAnimationFrame(frame);
  });
}

try {
  console.log(`${browser.version()} headless, ${cpus().length} cores, ${SECONDS} s each`);
  console.log('case                               | frames/s | draws/s | frame p50 | p99     | most    | main thread | samples | heap');
  for (const { name, query } of CASES) {
    const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
    page.on('pageerror', (error) => console.error(error.message));
    await page.goto(`http://127.0.0.1:${port}/?${query}`);
    await page.waitForFunction(() => globalThis.store?.curves.length > 0 && globalThis.store.curves.every(({ samples }) => samples.end > 0));
    const session = await page.context().newCDPSession(page);
    // The time of the processor, so that other programs on the machine do not count.
    await session.send('Performance.enable', { timeDomain: 'threadTicks' });
    const busy = async () => {
      const { metrics } = await session.send('Performance.getMetrics');
      return { task: metrics.find(({ name: of }) => of === 'TaskDuration').value, at: performance.now() / 1000 };
    };
    const before = await busy();
    const { frames, draws, p50, p99, most, heap, samples } = await page.evaluate(measure, SECONDS * 1000);
    const after = await busy();
    const load = (100 * (after.task - before.task)) / (after.at - before.at);
    const cells = [
      name.padEnd(34), frames.toFixed(1).padStart(8), draws.toFixed(1).padStart(7), `${p50.toFixed(1)} ms`.padStart(9),
      `${p99.toFixed(1)} ms`.padStart(7), `${most.toFixed(1)} ms`.padStart(7), `${load.toFixed(0)} %`.padStart(11),
      `${samples.toFixed(0)} MB`.padStart(7), `${heap.toFixed(0)} MB`,
    ];
    console.log(cells.join(' | '));
    await page.close();
  }
} finally {
  await browser.close();
  await server.close();
  rmSync(outDir, { recursive: true, force: true });
}
