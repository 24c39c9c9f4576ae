// What short words of drives and of the page mean. A tooltip does not open on a phone.

const WORDS = {
  line: 'A serial port, CAN interface or network port with its drives, such as st0.',
  latch: 'After a stop of all motors, motion is refused until somebody presses Release.',
  's16A': 'The current or torque as the drive counts it: 32767 is the full scale of its current measurement.',
  's16V': 'The voltage as the drive counts it: 32767 is the full scale.',
  's16degree': 'The angle as the drive counts it: 65536 is one electrical turn.',
  dpp: 'A speed as the drive counts it: the angle in s16degree that the motor turns in one PWM period.',
  ROM: 'Memory that keeps its values without supply. Each write wears it.',
  NACK: 'The drive received the request and refuses it, for example because it is not possible in this state.',
  retry: 'The same request was sent again, because no reply came or the reply was damaged.',
  damaged: 'The checksum or the length of the bytes is wrong.',
} as const;

export function Words({ of }: { of: readonly (keyof typeof WORDS)[] }) {
  return (
    <details class="words">
      <summary>What do {of.join(', ')} mean?</summary>
      <dl>
        {of.map((word) => (
          <div key={word}>
            <dt>{word}</dt>
            <dd>{WORDS[word]}</dd>
          </div>
        ))}
      </dl>
    </details>
  );
}
