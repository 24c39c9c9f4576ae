// Samples of a share: binary columns behind a header (docs/SHARE-PROTOCOL.md).
import type { Column, Group } from './wire';

/** Values of signals of a motor that were read together. Views of one buffer: copy what is kept. */
export interface Rows {
  line: string;
  motor: number;
  columns: Column[];
  /** The line's clock at `t[0] == 0`, in seconds. */
  t0: number;
  t: Float64Array;
  /** From request to reply, in seconds. */
  span: Float64Array;
  /** A column for each of `columns`. NaN is no value. */
  values: Float64Array[];
  /** Records that were lost just before, because this page was too slow. */
  lost: number;
}

const HEADER = 32;
const VERSION = 1;

/** The number of the group that a message belongs to, or null if it cannot be read. */
export function groupOf(buffer: ArrayBuffer): number | null {
  if (buffer.byteLength < HEADER) return null;
  const head = new DataView(buffer);
  return head.getUint32(0, true) === VERSION ? head.getUint32(4, true) : null;
}

/** The columns of a message with so many signals, or null if its size is not that of its rows. */
export function decodeColumns(buffer: ArrayBuffer, signals: number) {
  const head = new DataView(buffer);
  const rows = head.getUint32(12, true);
  const wide = signals + 2;
  if (head.getUint32(16, true) !== wide || buffer.byteLength !== HEADER + 8 * rows * wide) return null;
  const column = (at: number) => new Float64Array(buffer, HEADER + 8 * rows * at, rows);
  return {
    t0: head.getFloat64(24, true),
    t: column(0),
    span: column(1),
    values: Array.from({ length: signals }, (_, at) => column(at + 2)),
    lost: head.getUint32(20, true),
  };
}

/** The rows of a message of a group, or null if its size is not that of its rows and columns. */
export function decode(buffer: ArrayBuffer, { line, motor, columns }: Group): Rows | null {
  const decoded = decodeColumns(buffer, columns.length);
  return decoded && { line, motor, columns, ...decoded };
}
