import { defineConfig } from 'vite';

// Everything is a file of its own: the policy of the server allows no inline script and no data URL.
export default defineConfig({
  base: './',
  build: { assetsInlineLimit: 0, target: 'es2022', modulePreload: { polyfill: false } },
  oxc: { jsx: { runtime: 'automatic', importSource: 'preact' } },
  test: { include: ['src/**/*.test.ts', 'src/**/*.test.tsx'] },
} as import('vitest/config').ViteUserConfig);
