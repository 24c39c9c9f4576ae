// The values of a card. Only these are drawn again with each tick.
import { useEffect, useRef } from 'preact/hooks';
import { rates } from '../drives';
import { countOf, faultsText, told } from '../faults';
import { decimalsOf, decimalsOfStep, number, rate, sentence } from '../format';
import { state } from '../link';
import { HISTORY, type Live, liveOf } from '../overview';
import type { Description } from '../wire';

interface Props {
  line: string;
  motor: number;
  description: Description;
}

/** The faults with what to do. It has a varying height, so it is below the buttons. */
export function Faults({ line, motor, description }: Props) {
  const { value, old } = faultsOf(line, motor, description);
  if (Number.isNaN(value)) return null;
  const { shown, unknown } = told(value, description.faults);
  if (shown.length === 0 && unknown === 0) return null;
  return (
    <ul class="faults" aria-label="Faults">
      {shown.map(({ bit, name, doc, advice, present }) => (
        <li key={bit} class={`note ${present ? 'bad' : 'warn'}`}>
          <strong>
            {present ? '✕' : '!'} {name}
            {present ? '' : ' (occurred, not acknowledged)'}
            {old && ` (${old})`}
          </strong>
          <p>
            {sentence(doc)} {sentence(advice)}
          </p>
        </li>
      ))}
      {unknown !== 0 && (
        <li class="note bad">
          <strong>✕ Unknown faults 0x{unknown.toString(16)}</strong>
        </li>
      )}
    </ul>
  );
}

function faultsOf(line: string, motor: number, { overview }: Description) {
  const live = liveOf(line, motor);
  // Drawn again with each tick.
  void live.tick.value;
  return { value: live.values.get(overview.faults)?.value ?? NaN, old: live.old(overview.faults) };
}

function FaultCount({ line, motor, description }: Props) {
  const { value, old } = faultsOf(line, motor, description);
  if (Number.isNaN(value)) return <span class="muted">faults unknown</span>;
  const count = countOf(value, description.faults);
  if (old !== null) return <span class="muted">{faultsText(count)}, {old}</span>;
  if (count === 0) return <span class="ok">✓ no faults</span>;
  return <span class="chip bad">✕ {faultsText(count)}</span>;
}

/** The last 20 s of the speed. The numbers beside it say the same to a screen reader. */
function Spark({ live }: { live: Live }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const tick = live.tick.value;
  useEffect(() => {
    const element = canvas.current;
    const context = element?.getContext('2d');
    if (!element || !context) return;
    const scale = devicePixelRatio;
    const width = Math.round(element.clientWidth * scale);
    const height = Math.round(element.clientHeight * scale);
    if (element.width !== width) element.width = width;
    if (element.height !== height) element.height = height;
    context.clearRect(0, 0, width, height);
    let [low, high] = [0, 0];
    for (const value of live.history) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    const margin = 2 * scale;
    const y = (value: number) => height - margin - ((value - low) / (high - low || 1)) * (height - 2 * margin);
    const style = getComputedStyle(element);
    context.strokeStyle = style.borderBottomColor;
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(0, y(0));
    context.lineTo(width, y(0));
    context.stroke();
    context.strokeStyle = style.color;
    context.lineWidth = 1.5 * scale;
    context.beginPath();
    let isGap = true;
    live.history.forEach((value, at) => {
      if (Number.isNaN(value)) {
        isGap = true;
        return;
      }
      const x = (at / (HISTORY - 1)) * width;
      if (isGap) context.moveTo(x, y(value));
      else context.lineTo(x, y(value));
      isGap = false;
    });
    context.stroke();
  }, [tick]);
  return <canvas ref={canvas} class="spark" aria-hidden="true" />;
}

export function Values({ line, motor, description }: Props) {
  const { overview, states } = description;
  const live = liveOf(line, motor);
  // Drawn again with each tick.
  void live.tick.value;
  const last = (name: string) => live.values.get(name);
  const old = (name: string) => live.old(name);

  const status = overview.state === null ? undefined : last(overview.state);
  const known = states.find(({ value }) => value === status?.value);
  const stateOld = overview.state === null ? null : old(overview.state);
  const speedRate = rates.value.find(
    (one) => one.line === line && one.motor === motor && one.name === overview.speed,
  );

  const decimals = (name: string, unit: string) => {
    const step = description.registers.find((register) => register.name === name)?.range?.[2];
    return step ? decimalsOfStep(step) : decimalsOf(unit);
  };

  const shown: [string, string | null][] = [
    ['Speed', overview.speed],
    ['Current', overview.current],
    ['Angle', overview.angle],
    ['Temperature', overview.temperature],
    ['Voltage', overview.voltage],
  ];
  return (
    <div class="values">
      <p class="state">
        {overview.state !== null && (
          <span class={stateOld ? 'old' : undefined}>
            State{' '}
            <strong title={known?.doc}>
              {known?.name ?? (status && !Number.isNaN(status.value) ? `unknown (${status.value})` : 'no value')}
            </strong>
            {stateOld && status && ` (${stateOld})`}
          </span>
        )}
        <FaultCount line={line} motor={motor} description={description} />
      </p>
      <dl>
        {shown.map(([label, name]) => {
          if (name === null) return null;
          const value = last(name);
          const isOld = value ? old(name) : null;
          return (
            <div key={label} class={isOld ? 'value old' : 'value'}>
              <dt>{label}</dt>
              <dd>
                <span class="age">{isOld}</span>
                <span class="digits">{number(value?.value ?? NaN, decimals(name, value?.unit ?? ''))}</span>{' '}
                <span class="unit">{value?.unit}</span>
              </dd>
            </div>
          );
        })}
      </dl>
      <Spark live={live} />
      <p class="muted rates">
        <span>{!last(overview.speed) ? 'no value yet' : old(overview.speed) ? 'not live' : 'live'}</span>
        {speedRate && state.value === 'open' && (
          <span>
            asked {rate(1 / speedRate.asked)}, achieved {rate(old(overview.speed) ? NaN : speedRate.achieved || NaN)}
          </span>
        )}
        {live.lost > 0 && <span>{live.lost} lost: page too slow</span>}
      </p>
    </div>
  );
}
