// The samples of a signal, oldest first, with their extremes in three steps of 16. An interval of any
// length is searched in about 100 comparisons, so a spike is found at each zoom.
//
// Blocks of 4096 samples in typed arrays: memory grows with the samples, and the oldest block is
// used again once `capacity` is reached. A sample takes 18.2 bytes, see `BYTES`.

const STEP = 16;
const BLOCK = STEP ** 3;

/** Bytes that a sample takes: time, value, and the share of the extremes. */
export const BYTES = 8 + 8 + 16 * (1 / STEP + 1 / STEP ** 2 + 1 / STEP ** 3);

/** Stands for the values between two samples that were lost or never read. NaN is a sample without a value. */
export const BREAK = -Infinity;

/** The least and the most of some samples; `min > max` if none has a value. */
export interface Extremes {
  min: number;
  max: number;
}

class Block {
  readonly x = new Float64Array(BLOCK);
  readonly y = new Float64Array(BLOCK);
  /** Extremes of 16, 256 and 4096 samples, one level after the other. */
  readonly min = new Float64Array(LEVELS[3]!);
  readonly max = new Float64Array(LEVELS[3]!);

  clear() {
    this.min.fill(Infinity);
    this.max.fill(-Infinity);
  }

  widen(at: number, y: number) {
    for (let level = 0, entry = at >> 4; level < 3; level += 1, entry >>= 4) {
      const place = LEVELS[level]! + entry;
      if (y < this.min[place]!) this.min[place] = y;
      if (y > this.max[place]!) this.max[place] = y;
    }
  }
}

const LEVELS = [0, BLOCK / STEP, BLOCK / STEP + STEP, BLOCK / STEP + STEP + 1];

export class Samples {
  private readonly blocks: Block[] = [];
  /** The number of the first sample of `blocks[0]`. */
  private base = 0;
  /** Samples are numbered from 0. This is the number of the oldest one that is kept. */
  first = 0;
  /** The number that the next sample gets. */
  end = 0;
  /** Is another one whenever samples changed that were there before. */
  version = 0;

  /** Keeps at least `capacity` samples, and fewer than `capacity` + 8192. */
  constructor(private capacity = Infinity) {}

  /** Bytes in use. */
  get bytes(): number {
    return this.blocks.length * BLOCK * BYTES;
  }

  /** Keeps another number of samples. */
  resize(capacity: number) {
    this.capacity = capacity;
    this.drop();
  }

  clear() {
    this.base = this.end;
    this.first = this.end;
    this.blocks.length = 0;
    this.version += 1;
  }

  /** Appends a sample. Times must not decrease. */
  push(x: number, y: number) {
    const at = (this.end - this.base) % BLOCK;
    if (this.end === this.base + this.blocks.length * BLOCK) this.extend();
    const block = this.blocks[this.blocks.length - 1]!;
    block.x[at] = x;
    block.y[at] = y;
    if (isFinite(y)) block.widen(at, y);
    this.end += 1;
  }

  private extend() {
    const free = this.end - this.base - BLOCK >= this.capacity ? this.dropBlock() : new Block();
    free.clear();
    this.blocks.push(free);
  }

  private dropBlock(): Block {
    this.base += BLOCK;
    this.first = this.base;
    return this.blocks.shift()!;
  }

  private drop() {
    while (this.blocks.length > 1 && this.end - this.base - BLOCK >= this.capacity) this.dropBlock();
  }

  x(number: number): number {
    const at = number - this.base;
    return this.blocks[Math.floor(at / BLOCK)]!.x[at % BLOCK]!;
  }

  y(number: number): number {
    const at = number - this.base;
    return this.blocks[Math.floor(at / BLOCK)]!.y[at % BLOCK]!;
  }

  /** The time of the newest sample, NaN without one. */
  get newest(): number {
    return this.end > this.first ? this.x(this.end - 1) : NaN;
  }

  /** The time of the oldest sample, NaN without one. */
  get oldest(): number {
    return this.end > this.first ? this.x(this.first) : NaN;
  }

  /** The number of the first sample at `x` or later; `end` if there is none. */
  at(x: number, from = this.first): number {
    let low = Math.max(from, this.first);
    let high = this.end;
    while (low < high) {
      const middle = Math.floor((low + high) / 2);
      if (this.x(middle) < x) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The number of the sample with a value that is nearest to `x`; -1 without one within `within`. */
  nearest(x: number, within: number): number {
    let best = -1;
    let distance = within;
    const start = this.at(x);
    for (let number = start; number < this.end; number += 1) {
      if (this.x(number) - x > distance) break;
      if (isFinite(this.y(number))) {
        best = number;
        distance = this.x(number) - x;
        break;
      }
    }
    for (let number = start - 1; number >= this.first; number -= 1) {
      if (x - this.x(number) > distance) break;
      if (isFinite(this.y(number))) return number;
    }
    return best;
  }

  /** The extremes of the samples `from` to `end`, exclusive. */
  extremes(from: number, end: number, into: Extremes = { min: 0, max: 0 }): Extremes {
    into.min = Infinity;
    into.max = -Infinity;
    let at = Math.max(from, this.first) - this.base;
    const last = Math.min(end, this.end) - this.base;
    while (at < last) {
      const block = this.blocks[Math.floor(at / BLOCK)]!;
      const within = at % BLOCK;
      let level = -1;
      let length = 1;
      while (level < 2 && within % (length * STEP) === 0 && at + length * STEP <= last) {
        level += 1;
        length *= STEP;
      }
      if (level < 0) {
        const y = block.y[within]!;
        if (isFinite(y)) {
          if (y < into.min) into.min = y;
          if (y > into.max) into.max = y;
        }
      } else {
        const place = LEVELS[level]! + within / length;
        if (block.min[place]! < into.min) into.min = block.min[place]!;
        if (block.max[place]! > into.max) into.max = block.max[place]!;
      }
      at += length;
    }
    return into;
  }

  /** Takes their values from the samples at `x` or later. Returns how many had one. */
  blank(x: number): number {
    let blanked = 0;
    const start = this.at(x);
    for (let number = start; number < this.end; number += 1) {
      const at = number - this.base;
      const block = this.blocks[Math.floor(at / BLOCK)]!;
      if (isFinite(block.y[at % BLOCK]!)) blanked += 1;
      block.y[at % BLOCK] = NaN;
    }
    if (blanked > 0) this.rebuild(start);
    return blanked;
  }

  private rebuild(from: number) {
    for (let index = Math.floor((from - this.base) / BLOCK); index < this.blocks.length; index += 1) {
      const block = this.blocks[index]!;
      block.clear();
      const count = Math.min(BLOCK, this.end - this.base - index * BLOCK);
      for (let at = 0; at < count; at += 1) if (isFinite(block.y[at]!)) block.widen(at, block.y[at]!);
    }
    this.version += 1;
  }
}
