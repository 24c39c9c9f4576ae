// The runs that are kept: drawn over each other, and compared in a table.
import { computed, signal } from '@preact/signals';
import { type Series, Plot } from '../plot/static';
import { numbered } from '../plot/style';
import { download } from '../registers/download';
import { DEFINITIONS, type Figure, type FigureName, WAY } from '../step/analysis';
import { type Run, csv, figureText, fileName, json, remove, runs, title, unitOf } from '../step/run';

/** The runs that are not drawn, by number. New ones are drawn. */
const hidden = signal<ReadonlySet<number>>(new Set());

const drawnRuns = computed(() => runs.value.filter(({ number }) => !hidden.value.has(number)));
const series = computed(() => drawnRuns.value.flatMap(seriesOf));

let known: ReadonlyMap<string, number> = new Map();
/** The looks of the curves: a run keeps its colours when others come or go. */
const looks = computed(() => {
  const oldestFirst = [...runs.value].sort((one, other) => one.number - other.number);
  known = numbered(oldestFirst.flatMap(({ number }) => [measuredKey(number), referenceKey(number)]), known);
  return known;
});
const measuredKey = (run: number) => `${run} measured`;
const referenceKey = (run: number) => `${run} reference`;
const lookOf = (key: string) => looks.value.get(key) ?? 0;

const FIGURES = Object.keys(DEFINITIONS) as FigureName[];

export function Runs() {
  const all = runs.value;
  if (!all.length) return <p class="muted">No step was recorded yet.</p>;
  const shown = drawnRuns.value;
  return (
    <section aria-label="Recorded steps">
      <h3>Recorded steps</h3>
      <ul class="runs">
        {all.map((run) => (
          <li key={run.number}>
            <label class="check">
              <input
                type="checkbox"
                checked={!hidden.value.has(run.number)}
                onChange={({ currentTarget }) => show(run.number, currentTarget.checked)}
              />
              <span>
                {title(run)} <small class="muted">{new Date(run.when).toLocaleString('en-GB')}</small>
              </span>
            </label>
            <span class="buttons">
              <button type="button" aria-label={`Save run ${run.number} as CSV`} onClick={() => download(fileName(run, 'csv'), csv(run), 'text/csv')}>
                CSV
              </button>
              <button type="button" aria-label={`Save run ${run.number} as JSON`} onClick={() => download(fileName(run, 'json'), json(run), 'application/json')}>
                JSON
              </button>
              <button type="button" aria-label={`Remove run ${run.number}`} onClick={() => remove(run.number)}>
                Remove
              </button>
            </span>
          </li>
        ))}
      </ul>
      {shown.length > 0 && (
        <>
          <Plot label="Step responses; time 0 is the step" series={series.value} marks={STEP} height={320} />
          <Comparison shown={shown} />
        </>
      )}
    </section>
  );
}

const STEP = [{ label: 'step', t: 0 }];

function show(number: number, is: boolean) {
  const next = new Set(hidden.value);
  if (is) next.delete(number);
  else next.add(number);
  hidden.value = next;
}

/** A plot keeps what it computed from the same objects. */
const drawn = new WeakMap<Run, Series[]>();

function seriesOf(run: Run): Series[] {
  const earlier = drawn.get(run);
  if (earlier) return earlier;
  const of = (values: (number | null)[]) => values.map((value) => value ?? NaN);
  const { unit, t, from, to } = run;
  const look = lookOf(referenceKey(run.number));
  const reference: Series = run.reference
    ? { look, name: `${run.number} reference`, unit, t, values: of(run.reference), stepped: true }
    : { look, name: `${run.number} reference sent`, unit, t: [t[0] ?? -1, 0, t.at(-1) ?? 1], values: [from, to, to], stepped: true };
  const series = [{ look: lookOf(measuredKey(run.number)), name: `${run.number} ${run.measured}`, unit, t, values: of(run.y) }, reference];
  drawn.set(run, series);
  return series;
}

function Comparison({ shown }: { shown: readonly Run[] }) {
  const gains = [...new Set(shown.flatMap((run) => run.gains.map(({ name }) => name)))];
  return (
    <>
      <div class="scroll" role="region" aria-label="Comparison of the runs" tabIndex={0}>
        <table class="figures">
          <caption class="hidden">What the responses are like, and the gains of each</caption>
          <thead>
            <tr>
              <td />
              {shown.map((run) => (
                <th key={run.number} scope="col">
                  {title(run)}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {FIGURES.map((name) => (
              <tr key={name}>
                <th scope="row">
                  {DEFINITIONS[name].name}
                  <small>{DEFINITIONS[name].doc}</small>
                </th>
                {shown.map((run) => (
                  <td key={run.number}>
                    <FigureCell figure={run.analysis.figures[name]} unit={unitOf(name, run)} />
                  </td>
                ))}
              </tr>
            ))}
            <Row name="Measured" shown={shown} of={measuredText} />
            <Row name="Ramp of the drive" shown={shown} of={({ ramp }) => ramp} />
            <Row name="Remarks" shown={shown} of={remarksText} />
          </tbody>
          {gains.length > 0 && (
            <tbody>
              <tr class="group">
                <th scope="rowgroup" colSpan={shown.length + 1}>
                  Gains when the step was applied
                </th>
              </tr>
              {gains.map((name) => (
                <GainRow key={name} name={name} shown={shown} />
              ))}
            </tbody>
          )}
        </table>
      </div>
      <p class="muted">{WAY} Crossings are interpolated between two samples.</p>
    </>
  );
}

function FigureCell({ figure, unit }: { figure: Figure; unit: string }) {
  return (
    <>
      <span class={figure.kind === 'none' ? 'muted' : 'figure'}>{figureText(figure, unit)}</span>
      {figure.kind !== 'value' && <small>{figure.why}</small>}
    </>
  );
}

function Row({ name, shown, of }: { name: string; shown: readonly Run[]; of: (run: Run) => string }) {
  return (
    <tr>
      <th scope="row">{name}</th>
      {shown.map((run) => (
        <td key={run.number}>
          <small>{of(run)}</small>
        </td>
      ))}
    </tr>
  );
}

/** A gain of each run. One that differs from that of the first run is marked. */
function GainRow({ name, shown }: { name: string; shown: readonly Run[] }) {
  const texts = shown.map((run) => run.gains.find((gain) => gain.name === name));
  return (
    <tr>
      <th scope="row">
        <code>{name}</code>
      </th>
      {texts.map((gain, index) => {
        const differs = shown.length > 1 && gain?.text !== texts[0]?.text;
        return (
          <td key={shown[index]!.number} class={differs ? 'differs' : undefined}>
            {differs && <span aria-label="differs">≠ </span>}
            {gain ? `${gain.text} ${gain.unit}` : 'not read'}
          </td>
        );
      })}
    </tr>
  );
}

const rounded = (value: number) => String(Number(value.toPrecision(3)));

function measuredText({ analysis, unit, doubt, lost, carried }: Run): string {
  const parts = [
    `${analysis.samples} samples after the step, one each ${rounded(1000 * analysis.interval)} ms, at most ${rounded(1000 * analysis.longest)} ms apart`,
    ...(carried && carried < 0.9 * analysis.interval ? [`the line carries one each ${rounded(1000 * carried)} ms`] : []),
    ...(analysis.update > 1.5 * analysis.interval ? [`a new value each ${rounded(1000 * analysis.update)} ms`] : []),
    ...(analysis.resolution > 0 ? [`resolution ${rounded(analysis.resolution)} ${unit}`] : []),
    ...(analysis.noise >= 0 ? [`noise ${rounded(analysis.noise)} ${unit} (standard deviation)`] : []),
    `time of the step ±${rounded(1000 * doubt)} ms`,
    ...(lost ? [`${lost} samples were lost`] : []),
  ];
  return `${parts.join('; ')}.`;
}

function remarksText({ analysis, isThinned }: Run): string {
  const thinned = isThinned ? ['Points were left out to keep it in this browser. The numbers are of all points.'] : [];
  return [...analysis.remarks, ...thinned].join(' ') || 'none';
}
