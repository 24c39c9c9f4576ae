// The texts of marks: those that would lie over each other become one text.

export interface Label {
  /** The place of the mark, in pixels. */
  x: number;
  text: string;
  /** Whether the text is left of the mark: on its right there is no room. */
  isLeft: boolean;
}

/** Marks near each other. */
interface Group {
  x: number;
  count: number;
  text: string;
}

/** The texts of marks up to the right edge. `width` is that of a text; `gap` is left free beside it. */
export function labelsOf(
  marks: readonly { x: number; label: string }[],
  width: (text: string) => number,
  right: number,
  gap: number,
): Label[] {
  const isLeft = ({ x, text }: Group) => x + gap + width(text) > right;
  const end = (group: Group) => (isLeft(group) ? group.x : group.x + gap + width(group.text)) + gap;
  const start = (group: Group) => (isLeft(group) ? group.x - gap - width(group.text) : group.x);
  const groups: Group[] = [];
  for (const { x, label } of [...marks].sort((one, other) => one.x - other.x)) {
    let group: Group = { x, count: 1, text: label };
    for (let before = groups.at(-1); before && end(before) > start(group); before = groups.at(-1)) {
      groups.pop();
      const count = before.count + group.count;
      group = { x: before.x, count, text: `${count} events` };
    }
    groups.push(group);
  }
  return groups.map((group) => ({ x: group.x, text: group.text, isLeft: isLeft(group) }));
}
