// The memory of processes and pages.
import type { Page } from '@playwright/test';
import { readFileSync } from 'node:fs';

/** The memory of a process in bytes. */
export function resident(id: number): number {
  const line = /^VmRSS:\s+(\d+) kB/m.exec(readFileSync(`/proc/${id}/status`, 'utf8'));
  return 1024 * Number(line![1]);
}

/** The memory of a page after a collection of garbage, in bytes: objects, and the arrays of samples. */
export async function heap(page: Page) {
  const session = await page.context().newCDPSession(page);
  await session.send('HeapProfiler.collectGarbage');
  const use = await session.send('Runtime.getHeapUsage');
  await session.detach();
  return { objects: use.usedSize, arrays: use.backingStorageSize };
}
