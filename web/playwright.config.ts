import { defineConfig, devices } from '@playwright/test';
import { ARGUMENTS, PROGRAM } from './tests/chromium';

const chromium = { executablePath: PROGRAM, args: ARGUMENTS };

export default defineConfig({
  testDir: 'tests',
  fullyParallel: true,
  forbidOnly: !!process.env.CI,
  workers: Number(process.env.WORKERS ?? 2),
  timeout: 60_000,
  expect: { timeout: 15_000 },
  reporter: [['list']],
  use: { launchOptions: chromium, trace: { mode: 'retain-on-failure', screenshots: false, snapshots: false } },
  projects: [
    { name: 'desktop', use: { ...devices['Desktop Chrome'], viewport: { width: 1280, height: 800 } } },
    {
      name: 'phone',
      use: { ...devices['Pixel 7'], viewport: { width: 390, height: 844 } },
      testMatch: /(views|look)\.spec\.ts/,
    },
  ],
});
