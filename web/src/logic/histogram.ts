/** Histograms of times: buckets of any width, merged into columns on a logarithmic axis. */

export type Bucket = readonly [number, number, number]; // from [s], to [s], count

export interface Scale {
  low: number; // [s], a power of ten
  high: number;
}

/** Return the decades that contain all buckets, from 100 ns to 10 ms at least two decades. */
export function scaleOf(buckets: readonly Bucket[], floor = 1e-7): Scale {
  const used = buckets.filter(([, , n]) => n > 0);
  if (used.length === 0) return { low: 1e-6, high: 1e-3 };
  const smallest = Math.max(Math.min(...used.map(([from]) => from)), floor);
  const largest = Math.max(Math.max(...used.map(([, to]) => to)), floor * 10);
  const low = 10 ** Math.floor(Math.log10(smallest) + 1e-9);
  const high = 10 ** Math.ceil(Math.log10(largest) - 1e-9);
  return { low, high: Math.max(high, low * 100) };
}

/** Return the place of a time on the axis: 0 at `low`, 1 at `high`, clamped. */
export function place(time: number, scale: Scale): number {
  if (time <= scale.low) return 0;
  return Math.min(Math.log(time / scale.low) / Math.log(scale.high / scale.low), 1);
}

/**
 * Return the counts of `columns` columns of equal width. A bucket counts in the column of its middle.
 * The sum is the sum of all counts.
 */
export function columnsOf(buckets: readonly Bucket[], scale: Scale, columns: number): number[] {
  const counts = new Array<number>(columns).fill(0);
  for (const [from, to, n] of buckets) {
    const at = Math.min(Math.floor(place((from + to) / 2, scale) * columns), columns - 1);
    counts[at] = (counts[at] ?? 0) + n;
  }
  return counts;
}

/** Return the height of a count, 0 to 1, so that a single cycle among millions stays visible. */
export function height(n: number, largest: number): number {
  if (n <= 0 || largest <= 0) return 0;
  return Math.log10(1 + 9 * n) / Math.log10(1 + 9 * largest);
}

/** Return the counts that came after an earlier reading of the same histogram. */
export function difference(now: readonly Bucket[], before: readonly Bucket[]): Bucket[] {
  const earlier = new Map(before.map(([from, , n]) => [from, n]));
  return now.map(([from, to, n]) => [from, to, Math.max(n - (earlier.get(from) ?? 0), 0)] as const);
}

/** Return the powers of ten from `low` to `high`. */
export function decades(scale: Scale): number[] {
  const steps = Math.round(Math.log10(scale.high / scale.low));
  return Array.from({ length: steps + 1 }, (_, step) => scale.low * 10 ** step);
}
