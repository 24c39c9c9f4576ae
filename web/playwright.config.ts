import { defineConfig, devices } from '@playwright/test';
import { ARGUMENTS, PROGRAM } from './tests/chromium';

const chromium = { executablePath: PROGRAM, args: ARGUMENTS };
const desk = { ...devices['Desktop Chrome'], viewport: { width: 1280, height: 800 } };
const phone = { ...devices['Pixel 7'], viewport: { width: 390, height: 844 } };
const wide = { ...devices['Desktop Chrome'], viewport: { width: 1920, height: 1080 } };
/** How a page looks, and nothing else. */
const look = /@look/;
/** With LONG=1, in `make verify`: the other colour schemes, and a wide screen. */
const others = [
  { name: 'desk, dark', use: { ...desk, colorScheme: 'dark' as const }, grep: look },
  { name: 'phone, light', use: { ...phone, colorScheme: 'light' as const }, grep: look },
  { name: 'wide, light', use: { ...wide, colorScheme: 'light' as const }, grep: look },
  { name: 'wide, dark', use: { ...wide, colorScheme: 'dark' as const }, grep: look },
];

export default defineConfig({
  testDir: 'tests',
  fullyParallel: true,
  forbidOnly: !!process.env.CI,
  workers: Number(process.env.WORKERS ?? 2),
  // A test that hangs ends. Each of its waits has the time below.
  timeout: 600_000,
  expect: { timeout: 15_000 },
  reporter: [['list']],
  use: { launchOptions: chromium, trace: { mode: 'retain-on-failure', screenshots: false, snapshots: false } },
  projects: [
    { name: 'desk, light', use: { ...desk, colorScheme: 'light' } },
    { name: 'phone, dark', use: { ...phone, colorScheme: 'dark' }, grep: look },
    ...(process.env.LONG ? others : []),
  ],
});
