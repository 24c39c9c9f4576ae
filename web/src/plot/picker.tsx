// Chooses the signals of the plots, and how often they are read.
import { useMemo, useState } from 'preact/hooks';
import { motors } from '../link';
import { catalogue, settings } from './live';
import { candidates } from './search';
import { type Chosen, MOST_SIGNALS, RATES } from './settings';
import { keyOf, nameOf } from './store';

const MOST_SHOWN = 60;
const DEFAULT_RATE = 20;

const put = (signals: Chosen[]) => (settings.value = { ...settings.value, signals });

export function Picker() {
  const { signals } = settings.value;
  const [search, setSearch] = useState('');
  const [rate, setRate] = useState<number>(DEFAULT_RATE);
  const found = useMemo(
    () => candidates(motors.value, catalogue.value, search),
    [motors.value, catalogue.value, search],
  );
  const chosen = new Set(signals.map(keyOf));
  const isFull = signals.length >= MOST_SIGNALS;

  return (
    <details class="plots-picker">
      <summary>Signals ({signals.length})</summary>
      <div class="plots-choice">
        <div class="plots-search">
          <label>
            Search
            <input
              type="search"
              value={search}
              placeholder="st0/1 speed"
              onInput={({ currentTarget }) => setSearch(currentTarget.value)}
            />
          </label>
          <Rate label="Values a second" value={rate} onChange={setRate} />
          <ul aria-label="Signals that can be read">
            {found.slice(0, MOST_SHOWN).map((signal) => {
              const key = keyOf(signal);
              const is = chosen.has(key);
              return (
                <li key={key}>
                  <label>
                    <input
                      type="checkbox"
                      checked={is}
                      disabled={!is && isFull}
                      onChange={() =>
                        put(is ? signals.filter((one) => keyOf(one) !== key) : [...signals, { ...signal.id, rate }])}
                    />
                    <span>{nameOf(signal)} {signal.unit && <small>{signal.unit}</small>}</span>
                  </label>
                </li>
              );
            })}
          </ul>
          <p role="status">
            {found.length === 0
              ? 'Nothing matches.'
              : found.length > MOST_SHOWN
                ? `${MOST_SHOWN} of ${found.length}. Search to see others.`
                : `${found.length} signals.`}
            {isFull && ` At most ${MOST_SIGNALS} signals at once.`}
          </p>
        </div>
        {signals.length > 0 && (
          <div class="plots-chosen">
            <ul aria-label="Chosen signals">
              {signals.map((signal) => {
                const key = keyOf(signal);
                const name = nameOf(signal);
                return (
                  <li key={key}>
                    <span>{name}</span>
                    <Rate
                      label={`Values of ${name} a second`}
                      hidden
                      value={signal.rate}
                      onChange={(to) => put(signals.map((one) => (keyOf(one) === key ? { ...one, rate: to } : one)))}
                    />
                    <button type="button" aria-label={`Remove ${name}`} onClick={() => put(signals.filter((one) => keyOf(one) !== key))}>
                      Remove
                    </button>
                  </li>
                );
              })}
            </ul>
            <div class="plots-group">
              <button type="button" onClick={() => put(signals.map((one) => ({ ...one, rate })))}>All at {rate} a second</button>
              <button type="button" onClick={() => put([])}>Remove all</button>
            </div>
          </div>
        )}
      </div>
    </details>
  );
}

interface RateProps {
  label: string;
  hidden?: boolean;
  value: number;
  onChange: (rate: number) => void;
}

function Rate({ label, hidden = false, value, onChange }: RateProps) {
  const select = (
    <select aria-label={label} value={String(value)} onChange={({ currentTarget }) => onChange(Number(currentTarget.value))}>
      {RATES.map((rate) => <option key={rate} value={String(rate)}>{rate}/s</option>)}
    </select>
  );
  return hidden ? select : <label>{label}{select}</label>;
}
