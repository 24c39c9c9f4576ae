// The frames of a line: live, or around an instant.
import { useComputed, useSignal, useSignalEffect } from '@preact/signals';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import { frames, follow, gaps, isLoading, load, paused, refused } from '../frames/follow';
import {
  AROUND, type Filter, NO_FILTER, addressOf, asCsv, asText, bytesOf, countsOf, filtered, nearest, timeOf, told, troubleOf, wanted,
  windowOf,
} from '../frames/list';
import { timeOfDay } from '../format';
import { lines, wallAt, welcome } from '../link';
import { download } from '../registers/download';
import type { WireFrame } from '../wire';
import { Words } from '../words';
import './wire.css';

const WIRE_WORDS = ['line', 'NACK', 'retry', 'damaged'] as const;

/** As in wire.css. */
const NARROW = matchMedia('(max-width: 760px)');
const rowHeight = () => (NARROW.matches ? 44 : 28);

function useWanted() {
  const address = useSignal(location.hash);
  useEffect(() => {
    const moved = () => (address.value = location.hash);
    addEventListener('hashchange', moved);
    return () => removeEventListener('hashchange', moved);
  }, []);
  return useComputed(() => {
    const { line, t } = wanted(address.value);
    return { line: line ?? lines.value[0]?.line ?? null, t };
  });
}

export default function Wire() {
  const where = useWanted();
  const { line, t } = where.value;
  const filter = useSignal<Filter>(NO_FILTER);
  const chosen = useSignal<number | null>(null);
  const name = welcome.value?.name;
  useEffect(() => {
    paused.value = false;
    chosen.value = null;
    return follow({ line, t });
  }, [line, t, name]);
  const shown = useComputed(() => filtered(frames.value, filter.value));
  const mark = useComputed(() => {
    const { t: instant } = where.value;
    return instant === null ? -1 : nearest(shown.value, instant);
  });
  const set = (part: Partial<Filter>) => (filter.value = { ...filter.value, ...part });
  const save = (kind: 'txt' | 'csv') => {
    const [text, type] = kind === 'csv' ? [asCsv(shown.value), 'text/csv'] : [asText(shown.value), 'text/plain'];
    download(`${line}-frames.${kind}`, text, type);
  };
  const count = shown.value.length;
  return (
    <>
      <div class="bar">
        <h2>Wire</h2>
        <label>
          Line{' '}
          <select value={line ?? ''} onChange={({ currentTarget }) => (location.hash = addressOf(currentTarget.value))}>
            {line !== null && !lines.value.some((it) => it.line === line) && <option value={line}>{line}</option>}
            {lines.value.map((it) => (
              <option key={it.line} value={it.line}>
                {it.line}
              </option>
            ))}
          </select>
        </label>
        {t === null ? (
          <button type="button" aria-pressed={paused.value} onClick={() => (paused.value = !paused.value)}>
            {paused.value ? 'Continue' : 'Pause'}
          </button>
        ) : (
          <button type="button" disabled={line === null} onClick={() => line !== null && (location.hash = addressOf(line))}>
            Live
          </button>
        )}
        <button type="button" disabled={count === 0} onClick={() => save('txt')}>
          Save as text
        </button>
        <button type="button" disabled={count === 0} onClick={() => save('csv')}>
          Save as CSV
        </button>
      </div>
      <div class="bar">
        <label>
          Search{' '}
          <input
            type="search"
            placeholder="words or bytes"
            value={filter.value.text}
            onInput={({ currentTarget }) => set({ text: currentTarget.value })}
          />
        </label>
        <label>
          Direction{' '}
          <select
            value={filter.value.direction}
            onChange={({ currentTarget }) => set({ direction: currentTarget.value as Filter['direction'] })}
          >
            <option value="">both</option>
            <option value="to-drive">to the drive</option>
            <option value="from-drive">from the drive</option>
          </select>
        </label>
        <label class="check">
          <input
            type="checkbox"
            checked={filter.value.onlyErrors}
            onChange={({ currentTarget }) => set({ onlyErrors: currentTarget.checked })}
          />{' '}
          Only errors
        </label>
      </div>
      <p class="load">
        {t === null ? (paused.value ? 'Paused. ' : 'Live. ') : `From ${AROUND} s before ${timeOf(t)} s to ${AROUND} s after. `}
        {isLoading.value ? 'Loading …' : told(load.value, t === null)} {count > 0 && countsOf(shown.value)}
      </p>
      {gaps.value > 0 && <p class="warn">! Some frames between these are missing: the share has forgotten them.</p>}
      {refused.value !== null && (
        <p class="bad" role="alert">
          ! {refused.value}
        </p>
      )}
      <Frames line={line} shown={shown.value} mark={mark.value} isLive={t === null} chosen={chosen.value} onChosen={(number) => (chosen.value = number)} />
      <Words of={WIRE_WORDS} />
    </>
  );
}

interface Props {
  line: string | null;
  shown: readonly WireFrame[];
  /** The place of the frame that is nearest to the instant. */
  mark: number;
  isLive: boolean;
  chosen: number | null;
  onChosen: (number: number) => void;
}

function Frames({ line, shown, mark, isLive, chosen, onChosen }: Props) {
  const box = useRef<HTMLDivElement>(null);
  const top = useSignal(0);
  const height = useSignal(400);
  const row = useSignal(rowHeight());
  const lastTop = useRef(0);
  useEffect(() => {
    const measure = () => {
      row.value = rowHeight();
      height.value = box.current?.clientHeight ?? height.value;
    };
    measure();
    const watch = new ResizeObserver(measure);
    if (box.current) watch.observe(box.current);
    return () => watch.disconnect();
  }, []);
  const scrollTo = (to: number) => {
    if (!box.current) return;
    box.current.scrollTop = to;
    lastTop.current = box.current.scrollTop;
    top.value = lastTop.current;
  };
  // The newest frames are seen until somebody scrolls up.
  useLayoutEffect(() => {
    if (isLive && !paused.value) scrollTo(shown.length * row.value);
  }, [shown, isLive, row.value]);
  const marked = shown[mark]?.number;
  useLayoutEffect(() => {
    if (!isLive && mark >= 0) scrollTo((mark + 1) * row.value - height.value / 2);
  }, [marked, isLive, height.value]);
  useSignalEffect(() => {
    if (!paused.value && isLive) scrollTo(Number.MAX_SAFE_INTEGER);
  });

  const at = shown.findIndex(({ number }) => number === chosen);
  const frame = shown[at] ?? shown[mark];
  const choose = (place: number) => {
    const next = shown[Math.min(Math.max(0, place), shown.length - 1)];
    if (!next) return;
    if (isLive) paused.value = true;
    onChosen(next.number);
    const over = (shown.indexOf(next) + 1) * row.value;
    if (over - row.value < top.value) scrollTo(over - row.value);
    else if (over + row.value > top.value + height.value) scrollTo(over + row.value - height.value);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    const from = at >= 0 ? at : mark >= 0 ? mark : shown.length;
    const page = Math.max(1, Math.floor(height.value / row.value) - 2);
    const to = {
      ArrowUp: from - 1, ArrowDown: from + 1, PageUp: from - page, PageDown: from + page, Home: 0, End: shown.length - 1,
    }[event.key];
    if (to === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    choose(to);
  };
  const { first, end } = windowOf(shown.length, top.value, height.value, row.value);
  return (
    <>
      <div
        ref={box}
        class="frames"
        role="region"
        aria-label="Frames, arrow keys choose one"
        tabIndex={0}
        onKeyDown={onKeyDown}
        onScroll={({ currentTarget: { scrollTop } }) => {
          if (isLive && scrollTop < lastTop.current - 2) paused.value = true;
          lastTop.current = scrollTop;
          top.value = scrollTop;
        }}
      >
        <table aria-rowcount={shown.length + 1}>
          <caption class="hidden">Frames on the wire, the newest last</caption>
          <thead>
            <tr aria-rowindex={1}>
              <th scope="col" class="number">
                Time; line, s
              </th>
              <th scope="col">
                <span class="wide">Direction</span>
              </th>
              <th scope="col">Motor</th>
              <th scope="col">Result</th>
              <th scope="col">Bytes</th>
              <th scope="col">Meaning</th>
            </tr>
          </thead>
          <tbody>
            <Space rows={first} height={row.value} />
            {shown.slice(first, end).map((it, place) => (
              <Row
                key={it.number}
                frame={it}
                wall={dayOf(line, it)}
                index={first + place + 2}
                isChosen={it.number === frame?.number}
                isMarked={it.number === marked}
                onChosen={() => choose(first + place)}
              />
            ))}
            <Space rows={shown.length - end} height={row.value} />
          </tbody>
        </table>
        {shown.length === 0 && (
          <p class="muted">{frames.value.length > 0 ? 'No frame fits the search.' : !isLoading.value && 'No frames.'}</p>
        )}
      </div>
      <Detail frame={frame} wall={frame ? dayOf(line, frame) : ''} isMarked={frame !== undefined && frame.number === marked} />
    </>
  );
}

/** The time of the day of a frame. Plots and events have the same clock. */
const dayOf = (line: string | null, { t }: WireFrame) => timeOfDay(line === null ? NaN : wallAt(line, t));

/** Takes the place of rows that are not in the document. */
function Space({ rows, height }: { rows: number; height: number }) {
  return rows === 0 ? null : (
    <tr aria-hidden="true" class="space">
      <td style={{ height: `${rows * height}px` }} />
    </tr>
  );
}

interface RowProps {
  frame: WireFrame;
  wall: string;
  index: number;
  isChosen: boolean;
  isMarked: boolean;
  onChosen: () => void;
}

function Row({ frame, wall, index, isChosen, isMarked, onChosen }: RowProps) {
  const trouble = troubleOf(frame);
  const kind = isMarked ? 'marked' : isChosen ? 'chosen' : undefined;
  return (
    <tr aria-rowindex={index} aria-current={isChosen ? 'true' : undefined} class={kind} onClick={onChosen}>
      <td class="mono number">
        <span class="day">{wall}</span> {isMarked && '▶ '}
        {timeOf(frame.t)}
      </td>
      <td>
        {frame.direction === 'to-drive' ? '→' : '←'} <span class="wide">drive</span>
      </td>
      <td>{frame.motor ?? ''}</td>
      <td>{trouble && <span class={frame.result === 'foreign' ? 'muted' : 'bad'}>! {trouble}</span>}</td>
      <td class="mono">{bytesOf(frame)}</td>
      <td>
        <span>{frame.words}</span>
      </td>
    </tr>
  );
}

/** The whole of a frame: rows are cut. */
function Detail({ frame, wall, isMarked }: { frame: WireFrame | undefined; wall: string; isMarked: boolean }) {
  if (!frame) return <p class="muted frame">Choose a frame to see all of it.</p>;
  const trouble = troubleOf(frame);
  return (
    <section class="frame card" aria-label="Chosen frame">
      <p>
        <strong>
          {wall}, {timeOf(frame.t)} s of the line, {frame.direction === 'to-drive' ? 'to the drive' : 'from the drive'}
          {isMarked && ', nearest to the instant'}
        </strong>
        {trouble && <span class="bad"> ! {trouble}</span>}
      </p>
      <p>{frame.words}</p>
      <p class="mono">{bytesOf(frame)}</p>
    </section>
  );
}
