import { defineConfig } from '@playwright/test';

/** Measurements: `make deadman`, `make view`. */
export default defineConfig({ testDir: 'tests', testMatch: /\.measure\.ts$/, workers: 1, reporter: [['line']] });
