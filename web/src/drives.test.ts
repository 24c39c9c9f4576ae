import { type Signal, signal } from '@preact/signals';
import { beforeEach, describe, expect, it, vi } from 'vitest';

let drives: typeof import('./drives');
let link: Record<'entries' | 'found' | 'lines' | 'motors' | 'searchFailed' | 'searching' | 'welcome', Signal>;

beforeEach(async () => {
  link = {
    entries: signal([]),
    found: signal(new Map()),
    lines: signal([]),
    motors: signal(new Map()),
    searchFailed: signal(new Map()),
    searching: signal(new Set()),
    welcome: signal(null),
  };
  vi.doMock('./link', () => link);
  vi.doMock('./stop', () => ({ nameOf: (line: string, motor: number) => `${line}/${motor}` }));
  vi.resetModules();
  drives = await import('./drives');
});

const happened = (event: string) => void (link.entries.value = [...link.entries.value, { event, line: 'st0', motor: 1 }]);

describe('a motor', () => {
  it('is silent by its last event', () => {
    expect(drives.isSilent('st0', 1)).toBe(false);
    happened('silent');
    expect(drives.isSilent('st0', 1)).toBe(true);
    happened('answers');
    expect(drives.isSilent('st0', 1)).toBe(false);
  });

  it('is silent while its line is lost', () => {
    happened('answers');
    link.entries.value = [...link.entries.value, { event: 'lost', line: 'st0' }];
    expect(drives.isSilent('st0', 1)).toBe(true);
    link.entries.value = [...link.entries.value, { event: 'back', line: 'st0' }];
    expect(drives.isSilent('st0', 1)).toBe(false);
  });

  it('is not silent by an event from before its line was opened', () => {
    link.entries.value = [{ event: 'lost', line: 'st0', wall: 50 }, { event: 'silent', line: 'st0', motor: 1, wall: 50 }];
    expect(drives.isSilent('st0', 1)).toBe(true);
    link.lines.value = [{ line: 'st0', t: 10, wall: 100 }];
    expect(drives.isSilent('st0', 1)).toBe(false);
  });

  it('that did not confirm a stop is silent unless its values come', () => {
    happened('stop-failed');
    expect(drives.isSilent('st0', 1)).toBe(true);
    drives.rates.value = [{ line: 'st0', motor: 1, name: 'FLAGS', asked: 1, predicted: 1, achieved: 1 }];
    expect(drives.isSilent('st0', 1)).toBe(false);
    drives.rates.value = [];
    happened('stopped');
    expect(drives.isSilent('st0', 1)).toBe(false);
  });

  it('is silent without an event if the search did not find it and no values come', () => {
    link.searchFailed.value = new Map([['st0', 'no motor answers']]);
    expect(drives.isSilent('st0', 1)).toBe(true);
    drives.rates.value = [{ line: 'st0', motor: 1, name: 'FLAGS', asked: 1, predicted: 1, achieved: 1 }];
    expect(drives.isSilent('st0', 1)).toBe(false);
    drives.rates.value = [];
    link.searchFailed.value = new Map();
    link.found.value = new Map([['st0', [1]]]);
    expect([1, 2].map((motor) => drives.isSilent('st0', motor))).toEqual([false, true]);
  });
});

describe('rates', () => {
  it('of slow signals are kept for 3 s', () => {
    const rate = (achieved: number, asked = 0.5) => ({ line: 'st0', motor: 1, name: 'FLAGS', asked, predicted: asked, achieved });
    expect(drives.steady([rate(2)], 0)[0]!.achieved).toBe(2);
    expect(drives.steady([rate(0)], 2900)[0]!.achieved).toBe(2);
    expect(drives.steady([rate(0, 0.1)], 2900)[0]!.achieved).toBe(0);
    expect(drives.steady([rate(0)], 3100)[0]!.achieved).toBe(0);
  });
});

describe('a search', () => {
  it('has found nothing only when all lines were searched', () => {
    expect(drives.isSearched.value).toBe(false);
    link.welcome.value = {};
    expect(drives.isSearched.value).toBe(false);
    link.lines.value = [{ line: 'st0' }, { line: 'rmd0' }];
    link.found.value = new Map([['st0', []]]);
    expect(drives.isSearched.value).toBe(false);
    link.searchFailed.value = new Map([['rmd0', 'no motor answers']]);
    expect(drives.isSearched.value).toBe(true);
    link.searching.value = new Set(['st0']);
    expect(drives.isSearched.value).toBe(false);
  });
});
