// The memory of processes and pages.
import type { Browser, CDPSession } from '@playwright/test';
import { readFileSync } from 'node:fs';

/** The memory of a process in bytes. */
export function resident(id: number): number {
  const line = /^VmRSS:\s+(\d+) kB/m.exec(readFileSync(`/proc/${id}/status`, 'utf8'));
  return 1024 * Number(line![1]);
}

/** The memory of all processes of a browser that run pages, in bytes. */
export async function ofRenderers(browser: Browser): Promise<number> {
  const session = await browser.newBrowserCDPSession();
  const { processInfo } = await session.send('SystemInfo.getProcessInfo');
  await session.detach();
  return processInfo.filter(({ type }) => type === 'renderer').reduce((sum, { id }) => sum + resident(id), 0);
}

/** The memory of a page after a collection of garbage, in bytes: objects, and the arrays of samples. */
export async function heap(session: CDPSession) {
  await session.send('HeapProfiler.collectGarbage');
  const use = await session.send('Runtime.getHeapUsage');
  return { objects: use.usedSize, arrays: use.backingStorageSize };
}
