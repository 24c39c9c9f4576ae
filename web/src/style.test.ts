import { readFileSync } from 'node:fs';
import { expect, it } from 'vitest';
import { DARK, LIGHT } from './plot/style';

const css = readFileSync(new URL('style.css', import.meta.url), 'utf8');
const [light, dark] = [...css.matchAll(/:root \{([^}]*)\}/g)].map(([, body]) =>
  Object.fromEntries([...body!.matchAll(/--([\w-]+): (#[0-9a-f]{6});/g)].map(([, name, value]) => [name!, value!])),
);

function luminance(colour: string): number {
  const [r, g, b] = [1, 3, 5].map((at) => {
    const share = parseInt(colour.slice(at, at + 2), 16) / 255;
    return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
  });
  return 0.2126 * r! + 0.7152 * g! + 0.0722 * b!;
}

function contrast(one: string, other: string): number {
  const [low, high] = [luminance(one), luminance(other)].sort((a, b) => a - b);
  return (high! + 0.05) / (low! + 0.05);
}

/** Text on backgrounds, which needs 4.5. */
const TEXT: [string, string[]][] = [
  ['fg', ['bg', 'card', 'ok-bg', 'warn-bg', 'bad-bg']],
  ['muted', ['bg', 'card']],
  ['accent', ['bg', 'card']],
  ['ok', ['bg', 'card', 'ok-bg']],
  ['warn', ['bg', 'card', 'warn-bg']],
  ['bad', ['bg', 'card', 'bad-bg']],
  ['on-accent', ['accent']],
  ['on-stop', ['stop']],
];
/** Edges of controls and marks, which need 3. */
const MARKS: [string, string[]][] = [
  ['edge', ['bg', 'card']],
  ['focus', ['bg', 'card']],
  ['stop', ['bg', 'card']],
];

it.each([
  ['light', light!, LIGHT],
  ['dark', { ...light!, ...dark! }, DARK],
])('texts have a contrast of at least 4.5, edges and marks of 3, and curves of 4.5: %s', (_, colours, curves) => {
  const pairs = (list: [string, string[]][]) =>
    list.flatMap(([front, backs]) => backs.map((back) => [colours[front]!, colours[back]!, `${front} on ${back}`] as const));
  const drawn = curves.flatMap((one) => ['bg', 'card'].map((back) => [one, colours[back]!, `${one} on ${back}`] as const));
  const below = (least: number, all: (readonly [string, string, string])[]) =>
    all.filter(([front, back]) => !(contrast(front, back) >= least)).map(([, , name]) => name);
  expect([...below(4.5, [...pairs(TEXT), ...drawn]), ...below(3, pairs(MARKS))]).toEqual([]);
});
