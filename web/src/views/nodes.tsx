// The nodes of a fleet, and whose motors are shown.
import { type MotorId, allMotors, chosenNode, isSilent, lineEvents, nodes, shownNode } from '../drives';
import { faultSummary, faulty } from '../faults';
import { nodeOf } from '../format';
import { lines } from '../link';
import './nodes.css';

function State({ node }: { node: string }) {
  const own = lines.value.filter(({ line }) => nodeOf(line) === node);
  const lost = own.filter(({ line }) => lineEvents.value.get(line)?.event === 'lost').length;
  if (lost === own.length) return <span class="bad">✕ away</span>;
  return lost ? <span class="bad">! {lost} lines lost</span> : <span class="ok">● here</span>;
}

/** A number that is bad news unless it is 0. */
const Count = ({ of }: { of: number }) => <td class={`number${of ? ' bad' : ''}`}>{of}</td>;

function Row({ node, motors }: { node: string | null; motors: readonly MotorId[] }) {
  // Drawn again when faults change.
  void faultSummary.value;
  const isShown = shownNode.value === node;
  const unstopped = lines.value
    .filter(({ line }) => node === null || nodeOf(line) === node)
    .reduce((sum, { unstopped }) => sum + (unstopped?.length ?? 0), 0);
  return (
    <tr class={isShown ? 'shown' : ''}>
      <th scope="row">
        <button type="button" aria-pressed={isShown} onClick={() => (chosenNode.value = node)}>
          {node ?? 'All nodes'}
        </button>
      </th>
      <td>{node !== null && <State node={node} />}</td>
      <td class="number">{motors.length}</td>
      <Count of={motors.filter(({ line, motor }) => isSilent(line, motor)).length} />
      <Count of={faulty(motors)} />
      <Count of={unstopped} />
    </tr>
  );
}

/** A table of the nodes. Nothing without a fleet. */
export function Nodes() {
  if (nodes.value.length === 0) return null;
  const all = allMotors.value;
  return (
    <div class="nodes">
      <table>
        <caption class="hidden">Nodes</caption>
        <thead>
          <tr>
            <th scope="col">Node</th>
            <th scope="col">State</th>
            <th scope="col" class="number">Motors</th>
            <th scope="col" class="number">Silent</th>
            <th scope="col" class="number">Faulty</th>
            <th scope="col" class="number">Not stopped</th>
          </tr>
        </thead>
        <tbody>
          {nodes.value.length > 1 && <Row node={null} motors={all} />}
          {nodes.value.map((node) => (
            <Row key={node} node={node} motors={all.filter(({ line }) => nodeOf(line) === node)} />
          ))}
        </tbody>
      </table>
    </div>
  );
}
