// Curves of any signals of any motors.
import { computed, useSignal } from '@preact/signals';
import { useEffect, useMemo, useState } from 'preact/hooks';
import { motors, state } from '../link';
import { csv, iso, save } from '../plot/csv';
import { Figure } from '../plot/figure';
import { dayClock, duration, value } from '../plot/format';
import { curves, missing, scheduler, settings, start, store, time } from '../plot/live';
import { Picker } from '../plot/picker';
import { LAYOUTS, type Layout, SPANS } from '../plot/settings';
import { type Curve, LONGEST, nameOf } from '../plot/store';
import { age as old } from '../plot/format';
import type { Trace } from '../plot/chart';
import './plots.css';

const NAMES: Record<Layout, string> = { one: 'One plot', unit: 'A plot for each unit', motor: 'A plot for each motor' };
const clock = dayClock(store.origin);

/** What is drawn together. */
interface Panel {
  label: string;
  traces: Curve[];
}

const panels = computed<Panel[]>(() => {
  const { layout } = settings.value;
  const groups = new Map<string, Curve[]>();
  for (const curve of curves.value) {
    const of = { one: 'Signals', unit: curve.unit || 'Without unit', motor: `${curve.line}/${curve.motor}` }[layout];
    groups.set(of, [...(groups.get(of) ?? []), curve]);
  }
  return [...groups].map(([label, traces]) => ({ label, traces }));
});

const toWire = ({ line }: Trace, x: number) => {
  location.hash = `#/wire?${new URLSearchParams({ line, t: store.lineTime(line, x).toFixed(6) })}`;
};

const resume = () => {
  time.resume(settings.value.span);
  scheduler.request();
};

const newest = (trace: Trace) => {
  const curve = trace as Curve;
  const { samples } = curve;
  const age = store.look(curve);
  const has = samples.end > samples.first;
  return { text: has ? value(samples.y(samples.end - 1)) : '–', old: curve.old ? old(age) : '' };
};

const note = (trace: Trace) => {
  const { rate, period, samples, doubtful, refused } = trace as Curve;
  if (refused) return refused;
  const achieved = Math.round(1 / period);
  const slow = samples.end - samples.first > 1 && achieved < 0.9 * rate;
  return `${slow ? `${achieved} of ` : ''}${rate}/s${doubtful ? `, ${doubtful} doubtful left out` : ''}`;
};

export default function Plots() {
  useEffect(start, []);
  const height = useHeight();
  return (
    <section class="plots">
      <h2>Plots</h2>
      <Toolbar />
      <Picker />
      {missing.value.length > 0 && (
        <p class="plots-note">
          Not there now: {missing.value.map(nameOf).join(', ')}.
        </p>
      )}
      {panels.value.length === 0 && <Empty />}
      {panels.value.map(({ label, traces }) => (
        <Figure
          key={label}
          label={label}
          traces={traces}
          scheduler={scheduler}
          clock={clock}
          height={panels.value.length > 1 ? Math.min(height, 240) : height}
          live
          onPick={toWire}
          pickLabel="Show the wire"
          onHome={resume}
          newest={newest}
          note={note}
        />
      ))}
    </section>
  );
}

function Empty() {
  const any = [...motors.value.values()].some((found) => found.length > 0);
  return <p class="plots-note">{any ? 'Choose signals above.' : 'No motor was found yet.'}</p>;
}

function useHeight(): number {
  const narrow = useMemo(() => matchMedia('(max-width: 600px)'), []);
  const [isNarrow, setNarrow] = useState(narrow.matches);
  useEffect(() => {
    const change = () => setNarrow(narrow.matches);
    narrow.addEventListener('change', change);
    return () => narrow.removeEventListener('change', change);
  }, [narrow]);
  return isNarrow ? 260 : 400;
}

const LOOK = 250;

function Toolbar() {
  const now = useSignal({ live: true, behind: 0, lost: 0, kept: LONGEST });
  useEffect(() => {
    const look = () => {
      const behind = Math.max(0, Math.floor(store.now() - time.max));
      const next = { live: time.live, behind: time.live ? 0 : behind, lost: store.lost, kept: Math.round(store.kept) };
      if (JSON.stringify(next) !== JSON.stringify(now.peek())) now.value = next;
    };
    const timer = setInterval(look, LOOK);
    return () => clearInterval(timer);
  }, [now]);
  const [saving, setSaving] = useState(false);
  const { live, behind, lost, kept } = now.value;
  const { span, layout } = settings.value;

  const change = (by: () => void) => () => {
    by();
    now.value = { ...now.value, live: time.live };
    scheduler.request();
  };
  const setSpan = (seconds: number) => {
    settings.value = { ...settings.value, span: seconds };
    if (time.live) time.resume(seconds);
    else time.show(time.max - seconds, time.max);
  };
  const exportVisible = async () => {
    setSaving(true);
    try {
      const { min, max } = time;
      const parts = await csv(curves.value.filter(({ shown }) => shown), min, max, {
        header: ['time', 'line', 'line_seconds'],
        times: (x, line) => [iso(store.origin, x), line, store.lineTime(line, x).toFixed(6)],
      });
      save(`motorlink ${iso(store.origin, min).slice(0, 19).replaceAll(':', '')}.csv`, parts);
    } finally {
      setSaving(false);
    }
  };

  return (
    <div class="plots-bar" role="toolbar" aria-label="Time">
      <div class="plots-group">
        <button type="button" aria-pressed={!live} onClick={change(() => (time.live ? time.pause() : resume()))}>
          {live ? 'Pause' : 'Back to live'}
        </button>
        <select aria-label="Visible time" value={String(span)} onChange={({ currentTarget }) => change(() => setSpan(Number(currentTarget.value)))()}>
          {(SPANS as readonly number[]).includes(span) || <option value={String(span)}>{duration(span)}</option>}
          {SPANS.map((seconds) => (
            <option key={seconds} value={String(seconds)}>{seconds < 60 ? `${seconds} s` : `${seconds / 60} min`}</option>
          ))}
        </select>
      </div>
      <div class="plots-group">
        <button type="button" aria-label="Zoom in" onClick={change(() => time.zoom(0.5))}>+</button>
        <button type="button" aria-label="Zoom out" onClick={change(() => time.zoom(2))}>−</button>
        <button type="button" aria-label="Earlier" onClick={change(() => time.pan(-0.5))}>←</button>
        <button type="button" aria-label="Later" onClick={change(() => time.pan(0.5))}>→</button>
      </div>
      <div class="plots-group">
        <select
          aria-label="Division into plots"
          value={layout}
          onChange={({ currentTarget }) => (settings.value = { ...settings.value, layout: currentTarget.value as Layout })}
        >
          {LAYOUTS.map((one) => <option key={one} value={one}>{NAMES[one]}</option>)}
        </select>
        <button type="button" disabled={saving || curves.value.length === 0} onClick={() => void exportVisible()}>
          {saving ? 'Exporting…' : 'Export CSV'}
        </button>
      </div>
      <p class="plots-state">
        <strong class={live && state.value === 'open' ? 'plots-live' : 'plots-paused'}>
          {live ? (state.value === 'open' ? 'Live' : 'No connection') : `Paused, ${behind} s behind`}
        </strong>
        {lost > 0 && <span class="plots-lost"> {lost} records lost: this page was too slow.</span>}
        {kept < LONGEST && <span> Only the last {duration(kept)} are kept: too many values a second.</span>}
      </p>
    </div>
  );
}
