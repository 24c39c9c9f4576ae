// The visible samples as a table, a page at a time: what a plot shows, for those who do not see it.
import { useState } from 'preact/hooks';
import type { Trace } from './chart';
import type { Clock } from './format';
import { value } from './format';
import { type Row, rows, rowsBefore } from './rows';
import type { Window } from './window';

const PAGE = 50;

interface Props {
  id: string;
  label: string;
  traces: readonly Trace[];
  window: Window;
  clock: Clock;
}

interface Page {
  min: number;
  max: number;
  traces: readonly Trace[];
  rows: Row[];
}

export function Table({ id, label, traces, window, clock }: Props) {
  const [page, setPage] = useState<Page | null>(null);

  const from = (x: number, { min, max, traces: shown }: Omit<Page, 'rows'>, after: boolean) => {
    const found: Row[] = [];
    for (const row of rows(shown, x, max)) {
      if (after && row.x <= x) continue;
      found.push(row);
      if (found.length === PAGE) break;
    }
    setPage({ min, max, traces: shown, rows: found });
  };
  const before = (x: number, { min, max, traces: shown }: Omit<Page, 'rows'>) =>
    setPage({ min, max, traces: shown, rows: rowsBefore(shown, min, x, PAGE) });
  const read = () => {
    const { min, max } = window;
    from(min, { min, max, traces: traces.filter(({ shown }) => shown) }, false);
  };

  const first = page?.rows[0]?.x;
  const last = page?.rows[page.rows.length - 1]?.x;
  return (
    <details id={id} class="plot-table" onToggle={({ currentTarget }) => (currentTarget.open ? read() : setPage(null))}>
      <summary>Values as a table</summary>
      {page && (
        <>
          <div class="plot-pages">
            <button type="button" onClick={read}>Read the visible part</button>
            <button type="button" disabled={first === undefined} onClick={() => from(page.min, page, false)}>First</button>
            <button type="button" disabled={first === undefined} onClick={() => before(first!, page)}>Earlier</button>
            <button type="button" disabled={last === undefined} onClick={() => from(last!, page, true)}>Later</button>
            <button type="button" onClick={() => before(Infinity, page)}>Last</button>
          </div>
          <div class="plot-table-frame" tabIndex={0} role="region" aria-label={`Table of ${label}`}>
            <table>
              <caption>
                {first === undefined
                  ? 'No values here.'
                  : `${page.rows.length} rows from ${clock.full(first)} to ${clock.full(last!)}, of ${clock.full(page.min)} to ${clock.full(page.max)}`}
              </caption>
              <thead>
                <tr>
                  <th scope="col">Time</th>
                  {page.traces.map(({ key, name, unit }) => <th key={key} scope="col">{name}{unit && ` (${unit})`}</th>)}
                </tr>
              </thead>
              <tbody>
                {page.rows.map(({ x, line, values }) => (
                  <tr key={`${line} ${x}`}>
                    <th scope="row">{clock.full(x)}</th>
                    {values.map((number) => <td>{number === undefined ? '' : isNaN(number) ? 'no value' : value(number)}</td>)}
                  </tr>
                ))}
              </tbody>
            </table>
          </div>
        </>
      )}
    </details>
  );
}
