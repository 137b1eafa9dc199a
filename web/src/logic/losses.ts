/** Counters over time: increments in each second of the last two minutes. */

export const SECONDS = 120;

export interface Counts {
  lost: number;
  late: number;
}

export class LossHistory {
  private readonly slots = new Map<number, Counts>();
  private last: Counts | null = null;

  /** Add a reading of the counters at a time [s]. A smaller counter begins anew. */
  add(time: number, now: Counts): void {
    const before = this.last ?? now;
    this.last = now;
    const slot = this.slots.get(Math.floor(time)) ?? { lost: 0, late: 0 };
    this.slots.set(Math.floor(time), {
      lost: slot.lost + increase(before.lost, now.lost),
      late: slot.late + increase(before.late, now.late),
    });
    for (const second of this.slots.keys()) {
      if (second <= time - SECONDS) this.slots.delete(second);
    }
  }

  /** Return the counts of the last SECONDS seconds, oldest first. */
  counts(time: number): Counts[] {
    const newest = Math.floor(time);
    return Array.from(
      { length: SECONDS },
      (_, at) => this.slots.get(newest - SECONDS + 1 + at) ?? { lost: 0, late: 0 },
    );
  }
}

function increase(before: number, now: number): number {
  return now >= before ? now - before : now;
}
