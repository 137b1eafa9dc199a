/** Visible range of time: it follows the newest sample, or stands still. */

export interface Span {
  start: number; // [s]
  end: number;
}

const SHORTEST = 10; // periods

/** Owns the visible range. */
export class TimeView {
  /** null: the range follows the newest sample. */
  fixed: Span | null = null;

  constructor(public window: number) {}

  span(newest: number): Span {
    if (this.fixed !== null) return this.fixed;
    const end = Number.isFinite(newest) ? newest : 0;
    return { start: end - this.window, end };
  }

  /** Enlarge (factor > 1) or shrink around a time that keeps its place. */
  zoom(span: Span, factor: number, centre: number, period: number, longest: number): void {
    const length = span.end - span.start;
    const wanted = Math.min(Math.max(length * factor, SHORTEST * period), longest);
    const share = (centre - span.start) / length;
    const start = centre - share * wanted;
    this.fixed = { start, end: start + wanted };
  }

  pan(span: Span, seconds: number): void {
    this.fixed = { start: span.start + seconds, end: span.end + seconds };
  }

  follow(): void {
    this.fixed = null;
  }
}

/** Range of values of one scale. It grows at once, and shrinks when less than half is used. */
export class ValueRange {
  low = NaN;
  high = NaN;

  include(low: number, high: number): void {
    if (Number.isNaN(low)) return;
    const size = high - low || Math.abs(high) * 0.02 || 1;
    const fits = low >= this.low && high <= this.high;
    if (fits && size > 0.5 * (this.high - this.low)) return;
    const centre = (low + high) / 2;
    this.low = centre - 0.58 * size;
    this.high = centre + 0.58 * size;
  }
}

/** Return the text of a tick with as many digits as the distance of the ticks requires. */
export function tickText(value: number, step: number): string {
  let digits = 0;
  while (digits < 7 && !isWhole(step * 10 ** digits)) digits++;
  if (digits === 7 || Math.abs(value) >= 1e7) return value === 0 ? "0" : value.toExponential(2).replaceAll("-", "−");
  return (Math.abs(value) < step / 2 ? 0 : value).toFixed(digits).replace("-", "−");
}

function isWhole(value: number): boolean {
  return Math.round(value) > 0 && Math.abs(value - Math.round(value)) < 1e-6 * value;
}
