// Tables of measurements in the pages of docs.
import { readFileSync, writeFileSync } from 'node:fs';

const PAGE = '../docs/BENCHMARKS.md';

export type Cell = string | number;

export const row = (cells: readonly Cell[]) => `| ${cells.join(' | ')} |`;

/** A table of Markdown. All columns but the first `texts` are numbers. */
export function table(head: readonly Cell[], rows: readonly (readonly Cell[])[], texts = 1): string {
  const line = head.map((_, index) => (index < texts ? '---' : '--:'));
  return [head, line, ...rows].map(row).join('\n');
}

/** Writes text between the marks of this name in docs/BENCHMARKS.md, if that is wanted. */
export function publish(name: string, text: string) {
  if (!process.env.MOTORLINK_UPDATE_DOCS) return;
  const [begin, end] = [`<!-- ${name} -->`, `<!-- end of ${name} -->`];
  const page = readFileSync(PAGE, 'utf8');
  const [before, rest] = page.split(begin);
  const after = rest?.split(end)[1];
  if (after === undefined) throw new Error(`${PAGE} has no place for the table: ${begin}`);
  writeFileSync(PAGE, `${before}${begin}\n\n${text}\n\n${end}${after}`);
}

/** The value that this share of all values does not exceed. */
export function quantile(all: readonly number[], share: number): number {
  const sorted = [...all].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? NaN;
}

/** How fast values grow, by least squares, with twice its standard error. */
export function slope(points: readonly (readonly [x: number, y: number])[]) {
  const mean = (of: 0 | 1) => points.reduce((sum, point) => sum + point[of], 0) / points.length;
  const [x, y] = [mean(0), mean(1)];
  const squares = points.reduce((sum, point) => sum + (point[0] - x) ** 2, 0);
  const growth = points.reduce((sum, point) => sum + (point[0] - x) * (point[1] - y), 0) / squares;
  const rest = points.reduce((sum, point) => sum + (point[1] - y - growth * (point[0] - x)) ** 2, 0);
  return { growth, error: 2 * Math.sqrt(rest / (points.length - 2) / squares) };
}
