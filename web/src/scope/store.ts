/** Ring of the last rows of many signals. Memory is allocated only when a signal is added. */

/** Rows for each pair of minimum and maximum. */
export const BLOCK = 16;

export interface Column {
  readonly values: Float64Array;
  readonly low: Float64Array;
  readonly high: Float64Array;
}

/** Interval without samples; `row` is the marker row (NaN in each column). */
export interface Gap {
  readonly row: number;
  readonly rows: number; // lost on the way; 0 after a pause
}

export interface Rows {
  /** Cycle start of each row [s]. */
  readonly time: Float64Array;
  /** Names of the signals, in the order of `values`. */
  readonly names: readonly string[];
  readonly values: readonly Float64Array[];
  /** Rows lost directly before the first row. */
  readonly lost: number;
}

const MAX_GAPS = 1000;

export class RingStore {
  readonly capacity: number;
  readonly time: Float64Array;
  readonly columns = new Map<string, Column>();
  readonly gaps: Gap[] = [];
  readonly period: number;
  /** Number of rows since the start; row `end - 1` is the newest. */
  end = 0;
  /** Number of rows lost since the start. */
  lost = 0;
  /** Largest number of rows that may be read; fewer while the ring is not full. */
  readonly history: number;
  private names: readonly string[] = [];
  private assignment: [Column, number][] | null = null;

  constructor(seconds: number, period: number) {
    this.period = period;
    this.history = Math.ceil(seconds / period);
    this.capacity = (Math.ceil(this.history / BLOCK) + 1) * BLOCK;
    this.time = new Float64Array(this.capacity);
  }

  /** Oldest row that is valid in each column. */
  get begin(): number {
    return Math.max(0, this.end - this.history);
  }

  get lastTime(): number {
    return this.end === 0 ? -Infinity : this.timeOf(this.end - 1);
  }

  timeOf(row: number): number {
    return this.time[row % this.capacity]!;
  }

  value(name: string, row: number): number {
    return this.columns.get(name)?.values[row % this.capacity] ?? NaN;
  }

  add(name: string): void {
    if (this.columns.has(name)) return;
    this.assignment = null;
    const blocks = this.capacity / BLOCK;
    this.columns.set(name, {
      values: new Float64Array(this.capacity).fill(NaN),
      low: new Float64Array(blocks).fill(Infinity),
      high: new Float64Array(blocks).fill(-Infinity),
    });
  }

  remove(name: string): void {
    this.columns.delete(name);
    this.assignment = null;
  }

  clear(): void {
    this.end = 0;
    this.lost = 0;
    this.gaps.length = 0;
    for (const column of this.columns.values()) {
      column.values.fill(NaN);
      column.low.fill(Infinity);
      column.high.fill(-Infinity);
    }
  }

  /** Append rows that are newer than the last row. Time that runs backwards begins a new history. */
  append(rows: Rows): void {
    const count = rows.time.length;
    if (count === 0) return;
    if (rows.time[count - 1]! < this.lastTime - 1) this.clear();
    const from = this.firstNew(rows.time);
    if (from === count) return;
    const jump = rows.time[from]! - this.lastTime > 1.5 * this.period;
    if (jump && this.end > 0) this.appendGap(from === 0 ? rows.lost : 0);
    const kept = Math.max(from, count - this.history);
    this.write(this.time, rows.time, kept);
    for (const [column, index] of this.assigned(rows.names)) {
      if (index < 0) this.writeNothing(column, count - kept);
      else this.writeColumn(column, rows.values[index]!, kept);
    }
    this.end += count - kept;
  }

  /** Return the first row whose time is at least `time`; `end` if there is none. */
  rowAt(time: number): number {
    let low = this.begin;
    let high = this.end;
    while (low < high) {
      const middle = (low + high) >>> 1;
      if (this.timeOf(middle) < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Return each column with the index of its values; -1 if the rows do not contain it. */
  private assigned(names: readonly string[]): [Column, number][] {
    if (this.assignment === null || this.names !== names) {
      this.names = names;
      this.assignment = [...this.columns].map(([name, column]) => [column, names.indexOf(name)]);
    }
    return this.assignment;
  }

  private firstNew(time: Float64Array): number {
    const last = this.lastTime + this.period / 2;
    let index = 0;
    while (index < time.length && time[index]! < last) index++;
    return index;
  }

  private appendGap(rows: number): void {
    this.lost += rows;
    this.gaps.push({ row: this.end, rows });
    if (this.gaps.length > MAX_GAPS) this.gaps.shift();
    this.time[this.end % this.capacity] = this.lastTime + this.period;
    for (const column of this.columns.values()) this.writeNothing(column, 1);
    this.end++;
  }

  private write(ring: Float64Array, source: Float64Array, from: number): void {
    const start = this.end % this.capacity;
    const first = Math.min(source.length - from, this.capacity - start);
    ring.set(source.subarray(from, from + first), start);
    ring.set(source.subarray(from + first), 0);
  }

  private writeColumn(column: Column, source: Float64Array, from: number): void {
    const { values, low, high } = column;
    const capacity = this.capacity;
    let at = this.end % capacity;
    for (let index = from; index < source.length; index++) {
      const value = source[index]!;
      const block = (at / BLOCK) | 0;
      if (at % BLOCK === 0) {
        low[block] = Infinity;
        high[block] = -Infinity;
      }
      values[at] = value;
      if (value < low[block]!) low[block] = value;
      if (value > high[block]!) high[block] = value;
      if (++at === capacity) at = 0;
    }
  }

  private writeNothing(column: Column, count: number): void {
    for (let row = this.end; row < this.end + count; row++) {
      const at = row % this.capacity;
      if (at % BLOCK === 0) {
        column.low[at / BLOCK] = Infinity;
        column.high[at / BLOCK] = -Infinity;
      }
      column.values[at] = NaN;
    }
  }
}
