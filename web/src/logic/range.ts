/** Ranges of bars. */

export interface Range {
  low: number;
  high: number;
  limited: boolean; // true: limits of the axis; false: chosen to contain the value
}

/** Return the range of a position bar: the limits of the axis, else one that grows with the value. */
export function positionRange(
  low: number | null | undefined,
  high: number | null | undefined,
  value: number,
  base: number,
): Range {
  if (isLimit(low) && isLimit(high) && low < high) return { low, high, limited: true };
  const reach = grown(value, base);
  return { low: isLimit(low) ? low : -reach, high: isLimit(high) ? high : reach, limited: false };
}

/** Return a range around zero: the limit of the axis, else one that grows with the value. */
export function signedRange(limit: number | null | undefined, value: number, base: number): Range {
  const limited = isLimit(limit) && limit > 0;
  const reach = limited ? limit : grown(value, base);
  return { low: -reach, high: reach, limited };
}

/** Return the place of a value in a range, 0 to 1, clamped. */
export function fraction(value: number, range: Range): number {
  const at = (value - range.low) / (range.high - range.low);
  return Number.isNaN(at) ? 0 : Math.min(Math.max(at, 0), 1);
}

function isLimit(value: number | null | undefined): value is number {
  return value !== null && value !== undefined && Number.isFinite(value);
}

/** Return the smallest `base` times a power of two that contains the value. */
function grown(value: number, base: number): number {
  const size = Number.isFinite(value) ? Math.abs(value) : 0;
  return base * 2 ** Math.max(0, Math.ceil(Math.log2(size / base)));
}
